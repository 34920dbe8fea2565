"""These are scripts of users, run by ``tests/test_first_scripts.py``."""

collect_ignore_glob = ['*.py']
