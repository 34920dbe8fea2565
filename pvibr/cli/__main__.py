"""``python -m pvibr.cli``."""

from pvibr.cli.app import main

raise SystemExit(main())
