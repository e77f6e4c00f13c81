"""Our own files: every reader and writer of them, the exports to other programs, and how a file is put in place."""
