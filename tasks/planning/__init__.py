"""Plans: what a flight will determine."""
