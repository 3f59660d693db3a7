"""Published tables of life, and who printed them. Hours, degC and kV where nothing else is said."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Class-B motorettes, ten at each temperature: D. E. Crawford, Insulation/Circuits 16 (1970) 43; also W. B. Nelson, G.
# J. Hahn, Technometrics 14 (1972) 247; Kalbfleisch & Prentice 1980, p. 5; `motors` of R's MASS, `imotor` of R's
# survival.
_CLASS_B: dict[float, tuple[tuple[float, ...], float]] = {  # lives that ended, and how long the rest was watched
    150.0: ((), 8064.0),
    170.0: ((1764, 2772, 3444, 3542, 3780, 4860, 5196), 5448.0),
    190.0: ((408, 408, 1344, 1344, 1440), 1680.0),
    220.0: ((408, 408, 504, 504, 504), 528.0),
}
# Class-H motorettes: W. Nelson, Accelerated Testing, Wiley 1990, Table 2.1, p. 115, as in `NelsonData` of R's
# WeibullR.ALT 0.7.2. Other copies have 1898 where 1896 stands here.
_CLASS_H: dict[float, tuple[float, ...]] = {
    190.0: (7228, 7228, 7228, 8448, 9167, 9167, 9167, 9167, 10511, 10511),
    220.0: (1764, 2436, 2436, 2436, 2436, 2436, 3108, 3108, 3108, 3108),
    240.0: (1175, 1175, 1521, 1569, 1617, 1665, 1665, 1713, 1761, 1953),
    260.0: (600, 744, 744, 744, 912, 1128, 1320, 1464, 1608, 1896),
}
# A new-technology integrated circuit, looked at now and then: between which hours so many failed, by degC. W. Q.
# Meeker, L. A. Escobar, Statistical Methods for Reliability Data, Wiley 1998, Example 19.11, as in ReliaSoft's
# reference example "Arrhenius-Lognormal Model for Interval Data" (reliawiki.com).
_CIRCUITS: dict[float, tuple[tuple[float, float, int], ...]] = {
    150.0: ((1536, np.inf, 50),),
    175.0: ((1536, np.inf, 50),),
    200.0: ((96, np.inf, 50),),
    250.0: ((384, 788, 1), (788, 1536, 3), (1536, 2304, 5), (2304, np.inf, 41)),
    300.0: ((192, 384, 4), (384, 788, 27), (788, 1536, 16), (1536, np.inf, 3)),
}
# Mylar-polyurethane insulation under voltage, minutes by kV/mm: Meeker & Escobar 1998, Example 19.10, without the
# specimens at 361.4 kV/mm, as in ReliaSoft's reference example "Inverse Power Law (IPL)-Lognormal Model".
_MYLAR: dict[float, tuple[float, ...]] = {
    100.3: (606, 1012, 2520, 2610, 3988, 4100, 5025, 6842),
    122.4: (188, 297, 405, 744, 1218, 1340, 1715, 3382),
    157.1: (49, 99, 154.5, 180, 291, 447, 510, 600, 1656, 1721),
    219.0: (15, 16, 36, 50, 55, 95, 122, 129, 625, 700),
}
# Breakdown voltage, four specimens at each of 1, 2, 4, 8, 16, 32, 48, 64 weeks (rows) at 180, 225, 250, 275 degC: W.
# Nelson, IEEE Trans. Reliab. R-30 (1981) 149, as in NIST's Statistical Reference Datasets (Nelson.dat). Meeker &
# Escobar print 7.3 where 7.27 stands here.
_BREAKDOWN = """
15 17 15.5 16.5 | 15.5 15 16 14.5 | 15 14.5 12.5 11 | 14 13 14 11.5
14 16 13 13.5 | 13 13.5 12.5 12.5 | 12.5 12 11.5 12 | 13 11.5 13 12.5
13.5 17.5 17.5 13.5 | 12.5 12.5 15 13 | 12 13 12 13.5 | 10 11.5 11 9.5
15 15 15.5 16 | 13 10.5 13.5 14 | 12.5 12 11.5 11.5 | 6.5 5.5 6 6
18.5 17 15.3 16 | 13 14 12.5 11 | 12 12 11.5 12 | 6 6 5 5.5
12.5 13 16 12 | 11 9.5 11 11 | 11 10 10.5 10.5 | 2.7 2.7 2.5 2.4
13 13.5 16.5 13.6 | 11.5 10.5 13.5 12 | 7 6.9 8.8 7.9 | 1.2 1.5 1 1.5
13 12.5 16.5 16 | 11 11.5 10.5 10 | 7.27 7.5 6.7 7.6 | 1.5 1 1.2 1.2
"""


def class_b() -> tuple[Floats, Floats, Floats]:
    """Temperatures, and between which hours each life ended (inf: it had not)."""
    rows = [(degC, life, life) for degC, (ended, _) in _CLASS_B.items() for life in ended] + [
        (degC, until, np.inf) for degC, (ended, until) in _CLASS_B.items() for _ in range(10 - len(ended))
    ]
    degC, lower, upper = np.array(rows, np.float64).T
    return degC, lower, upper


def class_h() -> tuple[Floats, Floats]:
    """Temperatures and lives."""
    degC, life = np.array([(degC, life) for degC, lives in _CLASS_H.items() for life in lives], np.float64).T
    return degC, life


def circuits() -> tuple[Floats, Floats, Floats, Floats]:
    """Temperatures, between which hours so many failed (inf: had not), and how many."""
    rows = [(degC, *row) for degC, looks in _CIRCUITS.items() for row in looks]
    degC, lower, upper, counts = np.array(rows, np.float64).T
    return degC, lower, upper, counts


def mylar() -> tuple[Floats, Floats]:
    """Fields [kV/mm], and lives [min]."""
    field, life = np.array([(field, life) for field, lives in _MYLAR.items() for life in lives], np.float64).T
    return field, life


def breakdown() -> tuple[Floats, Floats, Floats]:
    """Temperatures, weeks of ageing, and strengths [kV]."""
    kV = np.array([[cell.split() for cell in row.split("|")] for row in _BREAKDOWN.strip().splitlines()], np.float64)
    weeks = np.array([1, 2, 4, 8, 16, 32, 48, 64], np.float64)[:, None, None] + np.zeros(kV.shape)
    degC = np.array([180, 225, 250, 275], np.float64)[None, :, None] + np.zeros(kV.shape)
    return degC.ravel(), weeks.ravel(), kV.ravel()
