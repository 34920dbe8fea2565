"""Control panels for what pvibr draws: in notebooks, in trame applications and in Qt windows."""
