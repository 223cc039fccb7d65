/* How far two convex sets are apart along one direction: a few products, where the narrowphase takes a search. */
#include "capi_contacts.h"

#include <math.h>

/* Hulls of more vertices are not looked through. */
enum { MAX_VERTICES = 128 };

/* The largest product of a body's points, seen from its origin, with a unit direction n; infinite where that is not known here.
   A half-space has one along its own normal alone, which is its z axis: n is that of `gap_along`. */
static double farthest(const int64_t *ints, const double *numbers, const double *X, const double n[3], double sign)
{
    const double *size = numbers + PARAMS;
    double m[3], largest = -INFINITE;
    int64_t k, padded = ints[PADDED];
    int j;
    for (j = 0; j < 3; j++) m[j] = sign * (X[j] * n[0] + X[4 + j] * n[1] + X[8 + j] * n[2]);
    if (ints[KIND] == CYLINDER) return size[0] * sqrt(m[0] * m[0] + m[1] * m[1]) + size[1] * fabs(m[2]);
    if (ints[KIND] == ELLIPSOID) {
        for (j = 0; j < 3; j++) m[j] *= size[j];
        return sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]);
    }
    if (ints[KIND] == HALFSPACE) return size[3];
    if (ints[KIND] != POINTS || ints[COUNT] > MAX_VERTICES) return INFINITE;
    if (size[0] > 0.0) /* a box */
        return size[0] * fabs(m[0]) + size[1] * fabs(m[1]) + size[2] * fabs(m[2]) + numbers[RADIUS];
    {
        const double *x = (const double *)(intptr_t)ints[ADDRESS], *y = x + padded, *z = y + padded;
        for (k = 0; k < padded; k++) {
            double along = x[k] * m[0] + y[k] * m[1] + z[k] * m[2];
            largest = along > largest ? along : largest;
        }
    }
    return largest + numbers[RADIUS];
}

double gap_along(const int64_t *ints_a, const double *numbers_a, const double *X_WA, const int64_t *ints_b,
                 const double *numbers_b, const double *X_WB, const double direction[3])
{
    double n[3], t[3], length, size, gap;
    int k;
    for (k = 0; k < 3; k++) {
        n[k] = ints_a[KIND] == HALFSPACE ? X_WA[4 * k + 2] : direction[k];
        t[k] = X_WB[4 * k + 3] - X_WA[4 * k + 3];
    }
    length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(length > 0.5) || ints_b[KIND] == HALFSPACE) return -INFINITE;
    for (k = 0; k < 3; k++) n[k] /= length;
    gap = t[0] * n[0] + t[1] * n[1] + t[2] * n[2] - farthest(ints_a, numbers_a, X_WA, n, 1.0) -
          farthest(ints_b, numbers_b, X_WB, n, -1.0);
    /* Some forty roundings, of numbers no larger than these: what is taken off is a million times that. */
    size = fabs(t[0]) + fabs(t[1]) + fabs(t[2]) + numbers_a[REACH] + numbers_a[RADIUS] + numbers_b[REACH] + numbers_b[RADIUS];
    return gap - 1e-9 * size;
}
