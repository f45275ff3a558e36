"""Writers of results for other programs, one file a format; `register` lists them."""
