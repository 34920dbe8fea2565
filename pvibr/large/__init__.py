"""One large mesh, drawn by a cut through a hierarchy of simplified patches."""
