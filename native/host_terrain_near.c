/* Facets of a height field near a convex body. */
#include "host_terrain_task.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int64_t cell_at(double x, int64_t n_cells)
{
    return !(x > 0.0) ? 0 : x >= (double)n_cells ? n_cells - 1 : (int64_t)x;
}

static int keep_near(struct terrain_space *own, const struct terrain_facet *facet, double gap, const double support[3])
{
    struct near_facet *near;
    if (own->n_near == own->capacity) {
        size_t capacity = own->capacity > 0 ? 2 * own->capacity : 64;
        if ((near = realloc(own->near, capacity * sizeof *near)) == NULL) return 0;
        own->near = near;
        own->capacity = capacity;
    }
    near = own->near + own->n_near++;
    near->gap = gap;
    memcpy(near->support, support, sizeof near->support);
    near->facet = *facet;
    near->is_hit = near->is_in_hull = 0;
    return 1;
}

int find_near(const struct terrain_pair *pair, const struct terrain_body *body, double margin, struct terrain_space *own)
{
    if (own != NULL) own->n_near = 0;
    return add_near(pair, body, margin, own);
}

int add_near(const struct terrain_pair *pair, const struct terrain_body *body, double margin, struct terrain_space *own)
{
    const struct terrain *terrain = pair->terrain;
    int64_t n_rows = terrain->n_rows - 1, n_columns = terrain->n_columns - 1, i, j, i_first, i_last, j_first, j_last;
    double length = sqrt(terrain->dx * terrain->dx + terrain->dy * terrain->dy), highest, lowest, needed;
    double diagonal[3] = {-terrain->dy / length, terrain->dx / length, 0.0};
    margin += 1e-9 * (body->reach + terrain->size[0] + terrain->size[1] + terrain->size[2] + terrain->size[3]);
    if (body->low[0] > terrain->size[0] + margin || body->high[0] < -terrain->size[0] - margin ||
        body->low[1] > terrain->size[1] + margin || body->high[1] < -terrain->size[1] - margin ||
        body->low[2] > terrain->size[2] + margin || body->high[2] < -terrain->size[3] - margin)
        return 0;
    needed = (body->low[2] - margin) / terrain->size[2]; /* a cell that is lower throughout is too low */
    body_extent(pair, body, diagonal, &lowest, &highest);
    j_first = cell_at((body->low[0] - margin + terrain->size[0]) / terrain->dx, n_columns);
    j_last = cell_at((body->high[0] + margin + terrain->size[0]) / terrain->dx, n_columns);
    i_first = cell_at((body->low[1] - margin + terrain->size[1]) / terrain->dy, n_rows);
    i_last = cell_at((body->high[1] + margin + terrain->size[1]) / terrain->dy, n_rows);
    for (i = i_first; i <= i_last; i++)
        for (j = j_first; j <= j_last; j++) {
            const float *h = terrain->heights + terrain->n_columns * i + j, *above = h + terrain->n_columns;
            double along = diagonal[0] * (terrain->dx * (double)j - terrain->size[0]) +
                           diagonal[1] * (terrain->dy * (double)i - terrain->size[1]);
            int t;
            if (h[0] < needed && h[1] < needed && above[0] < needed && above[1] < needed) continue;
            for (t = 0; t < 2; t++) {
                struct terrain_facet facet;
                double away[3], support[3], gap;
                int k;
                if (t == 0 ? lowest - along > margin || (h[0] < needed && h[1] < needed && above[1] < needed)
                           : along - highest > margin || (h[0] < needed && above[0] < needed && above[1] < needed))
                    continue;
                facet = facet_at(terrain, i, j, t);
                if (dot3(facet.n, body->p_HB) - dot3(facet.n, facet.v[0]) > body->reach + margin) continue;
                for (k = 0; k < 3; k++) away[k] = -facet.n[k];
                gap = -body_support(body, away, support) - dot3(facet.n, facet.v[0]);
                if (gap > margin) continue;
                if (own == NULL) return 1;
                if (!keep_near(own, &facet, gap, support)) return -1;
            }
        }
    return 0;
}

int is_off_terrain(const struct terrain_pair *pair)
{
    int64_t vertex;
    struct terrain_body body = body_seen_from(pair, &vertex);
    return find_near(pair, &body, pair->margin, NULL) == 0;
}
