"""One mesh many times, within an error."""
