from __future__ import annotations

import signal

from hypothesis import settings

# How long an example takes says more of the machine than of the code.
settings.register_profile('project', deadline=None)
settings.load_profile('project')

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # As in a background job of a shell: the programs under test would ignore Ctrl-C as well.
    signal.signal(signal.SIGINT, signal.default_int_handler)
