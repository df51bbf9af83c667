"""Making FMUs of the mechanisms."""
