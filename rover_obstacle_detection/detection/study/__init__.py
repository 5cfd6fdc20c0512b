"""The study's own method, with its listed errors corrected."""
