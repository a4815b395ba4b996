"""Makes sobol.csv: points of SciPy's unscrambled Sobol sequence in 64 dimensions.

    python sobol.py > sobol.csv
"""
import scipy
from scipy.stats import qmc

points = qmc.Sobol(64, scramble=False, bits=32).random(4096)
print(f"# scipy {scipy.__version__}, qmc.Sobol(64, scramble=False, bits=32): number of the point, its coordinates")
for n in [*range(48), *range(100, 4096, 211), 4095]:
    print(n, *(repr(float(x)) for x in points[n]), sep=",")
