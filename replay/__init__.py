"""Where logs, twin and SQL meet: replays, reports and the command line."""
