"""Reading and writing files: tables, curves, drawings, parameters and cases."""
