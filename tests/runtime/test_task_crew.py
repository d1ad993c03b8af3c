"""Ctrl-C within nested contexts."""

import os
import signal

from syncplan.runtime.task_crew import interruption


def test_ctrl_c_reaches_all_contexts_and_those_entered_later_within_them() -> None:
    with interruption() as outer:
        with interruption() as inner:
            assert not inner.is_set()
            os.kill(os.getpid(), signal.SIGINT)
            assert inner.is_set()
        assert outer.is_set()
        with interruption() as later:
            assert later.is_set()
    with interruption() as other:
        assert not other.is_set()
