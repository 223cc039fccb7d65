"""What every room stands on: checks of arguments, threads, locks, child processes, the log, whole files, the cache."""
