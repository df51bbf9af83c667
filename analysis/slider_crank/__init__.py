"""Analysis of the generalised slider-crank: the thesis's own method by dual numbers, and what is built on the plant."""
