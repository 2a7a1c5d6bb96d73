//! Fractions against formulas and against sums of small cells.
