"""Pages that draw in the browser what pvibr draws, in one file each."""
