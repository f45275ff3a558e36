"""What a flight will determine, before it is flown."""
