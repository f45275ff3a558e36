"""From when on an error is detectable, an observation controlled, and a parameter distinguishable."""

from __future__ import annotations

#: Non-centrality of the w-test for α0 = 0.1 % (two-sided) and power 80 %: 3.2905 + 0.8416.
NON_CENTRALITY = 4.132
#: With less control (without correlations: a smaller redundancy number) w means nothing.
UNCONTROLLED = 0.1
#: Part of a column's own squares CᵀC that must be left in addition to the unknowns: less is rounding and what
# linear
#: equations leave out, and the alternative cannot be separated from what is estimated.
INDISTINGUISHABLE = 1e-6
