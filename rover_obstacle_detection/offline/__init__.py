"""The work over recordings and image files behind ``replay``, ``detect`` and ``evaluate``."""
