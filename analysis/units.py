"""Units of quantities, and quantities read from text."""
