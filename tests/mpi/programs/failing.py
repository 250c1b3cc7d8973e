"""One process fails: alone, or while the others wait for its data."""

import sys

from mpi4py import MPI

from gfmd_cli.errors import GfmdError, SpaceError
from gfmd_cli.grid import ranks as module

ranks = module.Ranks(MPI.COMM_WORLD)
module.ABORT_AFTER_SECONDS = 1.0
try:
    with module.shared_errors(ranks):
        if ranks.rank == 1:
            raise SpaceError("no space on one of them") if sys.argv[1] == "known" else KeyError("x")
        if sys.argv[2] == "waiting":
            ranks.total(1.0)
except GfmdError as error:
    print(f"rank {ranks.rank}: {error}", flush=True)
    sys.exit(error.exit_status)
