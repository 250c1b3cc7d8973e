import os

# One thread for BLAS: side by side with other workers its threads spin for longer than they work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
