"""Expected values by other ways than the library's, one module for each module of tests."""
