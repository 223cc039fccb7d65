/* What programs here begin with. */
#ifndef HELPERS_H
#define HELPERS_H

#include <collide.h>

#include <stdio.h>
#include <stdlib.h>

/* Leave with a sentence unless all went well. */
static void require(collide_status status, const char *what)
{
    if (status == COLLIDE_OK) return;
    fprintf(stderr, "%s: %s\n", what, collide_status_text(status));
    exit(1);
}

/* A pose that is a shift [m], row by row. */
static void set_place(double *X, double x, double y, double z)
{
    int k;
    for (k = 0; k < 16; k++) X[k] = k % 5 == 0 ? 1.0 : 0.0;
    X[3] = x;
    X[7] = y;
    X[11] = z;
}

#endif
