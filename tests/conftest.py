"""What holds for the whole suite."""

import signal

# A suite that a script starts in the background is deaf to interrupts, as are the commands it runs.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
