"""Planning: what a flight will determine."""
