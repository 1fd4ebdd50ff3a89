"""Independent re-implementations that tests compare the library with."""
