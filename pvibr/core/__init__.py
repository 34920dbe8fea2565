"""What everything else stands on: settings, effects, frames, reports, errors, files."""
