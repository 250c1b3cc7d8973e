"""Print the environment in which numerical libraries compute as on a plain x86-64 processor.

Numba compiles without vector extensions, OpenBLAS takes its generic kernels, and NumPy takes none
of the loops that it chooses at run time. Last bits then are those of another machine. FFTW has no
such switch. Usage: env $(python scripts/plain_processor.py) COMMAND
"""

from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

here = [name for name in __cpu_dispatch__ if __cpu_features__.get(name)]
print("NUMBA_CPU_NAME=generic NUMBA_CPU_FEATURES= OPENBLAS_CORETYPE=Prescott")
print(f"NPY_DISABLE_CPU_FEATURES={','.join(here)}")
