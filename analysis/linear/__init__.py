"""Linear models of a mechanism, and controllers designed on them."""
