"""HTML pages in one file, with their pictures inside, that can be opened from a mail."""
