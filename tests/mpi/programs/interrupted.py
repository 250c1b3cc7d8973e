"""`gfmd run`, but one process gets a signal when it sees the state on 128 x 128 the n-th time."""

import sys

from gfmd_cli.cli import main
from gfmd_cli.study.run_task import TaskWatcher

count, looks, rank = 0, int(sys.argv.pop(1)), int(sys.argv.pop(1))
look = TaskWatcher.__call__


def interrupted(self, contact, state):
    global count
    if contact.grid.points == 128:
        count += 1
        if (
            count == looks
            and (0 if self.context.ranks is None else self.context.ranks.rank) == rank
        ):
            self.context.stop.set()
    look(self, contact, state)


TaskWatcher.__call__ = interrupted
main(sys.argv[1:])
