"""What every document is made of: tables, axes, maps, legends, colours."""
