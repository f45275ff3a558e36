"""Statements about accuracy as published standards want them."""
