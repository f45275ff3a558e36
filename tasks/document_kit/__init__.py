"""Parts shared by all documents: tables, axes, maps, legends, colours."""
