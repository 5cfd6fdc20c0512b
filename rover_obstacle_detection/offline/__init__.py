"""The detector over recordings and image files: the work behind ``replay`` and ``detect``."""
