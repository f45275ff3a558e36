"""An extension of aerocal: an observation type, a set of additional parameters, a file format."""
