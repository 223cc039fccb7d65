/* The vertices of an intersection of half-spaces, exactly: collide/hull/double_description.py in C, ray by ray in the same
   order.

   The half-spaces {x : n.x <= b} become a cone {(x, w) : b w - n.x >= 0, w >= 0} in four dimensions (Motzkin, Raiffa, Thompson
   and Thrall 1953; Fukuda and Prodon 1996 for the adjacency test). Its extreme rays with w > 0 are the vertices, those with w = 0
   directions in which the set never ends. */
#include "capi_internal.h"
#include "capi_bigint.h"

#include <stdlib.h>
#include <string.h>

/* A half-space, or a ray; integers without a common divisor. */
struct row {
    struct bigint at[4];
};

struct ray {
    struct row row;
    uint32_t *tight; /* a bit for each row that the ray lies on */
};

/* Rays so far. Numbers and bits stand in the arena of all. */
struct rays {
    struct ray *all;
    size_t n, capacity;
};

struct work {
    struct arena arena, scratch;
    struct row *rows;
    size_t n_rows, words; /* rows, and limbs of their bits */
};

static struct bigint dot(struct arena *arena, const struct row *a, const struct row *b)
{
    struct bigint sum = bigint_product(arena, a->at[0], b->at[0]);
    int k;
    for (k = 1; k < 4; k++) sum = bigint_sum(arena, sum, bigint_product(arena, a->at[k], b->at[k]));
    return sum;
}

/* Numbers made in the scratch, coprime and kept. */
static struct row kept(struct work *work, struct row row)
{
    int k;
    bigint_make_coprime(&work->scratch, row.at, 4);
    for (k = 0; k < 4; k++) row.at[k] = bigint_copy(&work->arena, row.at[k]);
    return row;
}

static int is_known(const struct work *work, const struct row *row)
{
    size_t i;
    for (i = 0; i < work->n_rows; i++) {
        const struct row *other = work->rows + i;
        int k = 0;
        while (k < 4 && bigint_equal(row->at[k], other->at[k])) k++;
        if (k == 4) return 1;
    }
    return 0;
}

/* Rows (-n, b), each once, and (0, 0, 0, 1) behind them. */
static int take_rows(struct work *work, const double *normals, const double *offsets, size_t m)
{
    size_t i;
    if ((work->rows = arena_take(&work->arena, (m + 1) * sizeof *work->rows)) == NULL) return 0;
    work->n_rows = 0;
    for (i = 0; i <= m; i++) {
        struct mark mark = arena_mark(&work->scratch);
        struct row row;
        int k;
        for (k = 0; k < 3; k++) row.at[k] = bigint_of(&work->scratch, i < m ? -normals[3 * i + k] : 0.0);
        row.at[3] = bigint_of(&work->scratch, i < m ? offsets[i] : 1.0);
        row = kept(work, row);
        arena_return(&work->scratch, mark);
        if (work->arena.failed || work->scratch.failed) return 0;
        if (!is_known(work, &row)) work->rows[work->n_rows++] = row;
    }
    work->words = (work->n_rows + 31) / 32;
    return 1;
}

static int pivot_of(const struct row *row)
{
    int k = 0;
    while (k < 4 && row->at[k].sign == 0) k++;
    return k;
}

/* The first four linearly independent rows; how many there are. */
static size_t independent(struct work *work, size_t start[4])
{
    struct row basis[4];
    size_t found = 0, i, j;
    for (i = 0; i < work->n_rows && found < 4; i++) {
        struct row rest = work->rows[i];
        for (j = 0; j < found; j++) { /* without fractions: rest * pivot - factor * basis */
            int pivot = pivot_of(basis + j), k;
            struct bigint factor = rest.at[pivot], by = basis[j].at[pivot];
            for (k = 0; k < 4; k++)
                rest.at[k] = bigint_difference(&work->scratch, bigint_product(&work->scratch, rest.at[k], by),
                                              bigint_product(&work->scratch, factor, basis[j].at[k]));
        }
        if (work->scratch.failed || pivot_of(&rest) == 4) continue;
        basis[found] = rest;
        start[found++] = i;
    }
    return found;
}

/* a0 (b1 c2 - b2 c1) - a1 (b0 c2 - b2 c0) + a2 (b0 c1 - b1 c0) of columns i, j, k. */
static struct bigint minor(struct arena *arena, const struct row *const *r, int i, int j, int k)
{
    int c[3], turn;
    struct bigint sum, part;
    c[0] = i;
    c[1] = j;
    c[2] = k;
    sum = bigint_of(arena, 0.0);
    for (turn = 0; turn < 3; turn++) {
        int x = c[turn], y = c[(turn + 1) % 3], z = c[(turn + 2) % 3];
        part = bigint_product(arena, r[1]->at[y], r[2]->at[z]);
        part = bigint_difference(arena, part, bigint_product(arena, r[1]->at[z], r[2]->at[y]));
        sum = bigint_sum(arena, sum, bigint_product(arena, r[0]->at[x], part));
    }
    return sum;
}

/* The ray on three of four rows that is not below the fourth. */
static struct row corner_ray(struct work *work, const struct row *const *on, const struct row *apart)
{
    struct row ray;
    int k;
    ray.at[0] = minor(&work->scratch, on, 1, 2, 3);
    ray.at[1] = minor(&work->scratch, on, 0, 2, 3);
    ray.at[2] = minor(&work->scratch, on, 0, 1, 3);
    ray.at[3] = minor(&work->scratch, on, 0, 1, 2);
    ray.at[1].sign = -ray.at[1].sign;
    ray.at[3].sign = -ray.at[3].sign;
    if (dot(&work->scratch, apart, &ray).sign < 0)
        for (k = 0; k < 4; k++) ray.at[k].sign = -ray.at[k].sign;
    return kept(work, ray);
}

static void set_bit(uint32_t *bits, size_t k) { bits[k / 32] |= (uint32_t)1 << k % 32; }

static int append(struct work *work, struct rays *rays, struct row row, uint32_t *tight)
{
    if (rays->n == rays->capacity) {
        size_t capacity = 2 * rays->capacity + 64;
        struct ray *more = capacity > (size_t)-1 / sizeof *more ? NULL : realloc(rays->all, capacity * sizeof *more);
        if (more == NULL) return 0;
        rays->all = more;
        rays->capacity = capacity;
    }
    rays->all[rays->n].row = row;
    rays->all[rays->n++].tight = tight;
    return !work->arena.failed && !work->scratch.failed;
}

static uint32_t *no_bits(struct work *work)
{
    uint32_t *bits = arena_take(&work->arena, work->words * sizeof *bits);
    if (bits != NULL) memset(bits, 0, work->words * sizeof *bits);
    return bits;
}

static int begin_rays(struct work *work, struct rays *rays, const size_t start[4])
{
    size_t apart, k;
    for (apart = 0; apart < 4; apart++) {
        const struct row *on[3];
        uint32_t *tight = no_bits(work);
        size_t n_on = 0;
        if (tight == NULL) return 0;
        for (k = 0; k < 4; k++)
            if (k != apart) {
                on[n_on++] = work->rows + start[k];
                set_bit(tight, start[k]);
            }
        if (!append(work, rays, corner_ray(work, on, work->rows + start[apart]), tight)) return 0;
    }
    return 1;
}

static int count_bits(uint32_t word)
{
    int found = 0;
    for (; word != 0; word &= word - 1) found++;
    return found;
}

/* Two extreme rays span a face of dimension two if no third ray is tight on all they share: `common`, made here. */
static int are_adjacent(const struct work *work, const struct rays *rays, const struct ray *one, const struct ray *other,
                        uint32_t *common)
{
    size_t w, k;
    int bits = 0, on_it = 0;
    for (w = 0; w < work->words; w++) {
        common[w] = one->tight[w] & other->tight[w];
        bits += count_bits(common[w]);
    }
    if (bits < 2) return 0;
    for (k = 0; k < rays->n && on_it < 3; k++) {
        for (w = 0; w < work->words && (rays->all[k].tight[w] & common[w]) == common[w]; w++) {}
        on_it += w == work->words;
    }
    return on_it == 2;
}

/* The ray between two on either side of a row: inside * outside ray - outside * inside ray. */
static struct row between(struct work *work, const struct ray *out, struct bigint side_out, const struct ray *in,
                          struct bigint side_in)
{
    struct row ray;
    int k;
    for (k = 0; k < 4; k++)
        ray.at[k] = bigint_difference(&work->scratch, bigint_product(&work->scratch, side_in, out->row.at[k]),
                                     bigint_product(&work->scratch, side_out, in->row.at[k]));
    return kept(work, ray);
}

/* Rays that span what row number k leaves of the cone of the rays given. */
static int cut(struct work *work, const struct rays *rays, size_t k, struct rays *out)
{
    struct mark outer = arena_mark(&work->scratch);
    struct bigint *sides = arena_take(&work->scratch, (rays->n + 1) * sizeof *sides);
    uint32_t *common = arena_take(&work->scratch, (work->words + 1) * sizeof *common);
    size_t i, j;
    int good = sides != NULL && common != NULL;
    out->n = 0;
    for (i = 0; good && i < rays->n; i++) {
        sides[i] = dot(&work->scratch, work->rows + k, &rays->all[i].row);
        if (sides[i].sign == 0) set_bit(rays->all[i].tight, k); /* nobody asks for rays as they were, but for rows before k */
    }
    for (i = 0; good && i < rays->n; i++)
        if (sides[i].sign >= 0) good = append(work, out, rays->all[i].row, rays->all[i].tight);
    for (i = 0; good && i < rays->n; i++) {
        if (sides[i].sign >= 0) continue;
        for (j = 0; good && j < rays->n; j++) {
            struct mark mark;
            uint32_t *tight;
            if (sides[j].sign <= 0 || !are_adjacent(work, rays, rays->all + i, rays->all + j, common)) continue;
            mark = arena_mark(&work->scratch);
            if ((tight = no_bits(work)) == NULL) return 0;
            memcpy(tight, common, work->words * sizeof *tight);
            set_bit(tight, k);
            good = append(work, out, between(work, rays->all + i, sides[i], rays->all + j, sides[j]), tight);
            arena_return(&work->scratch, mark);
        }
    }
    arena_return(&work->scratch, outer);
    return good && !work->arena.failed && !work->scratch.failed;
}

/* Extreme rays of the whole cone: 1; 0 where memory ended, -1 where it has no corner. */
static int extreme_rays(struct work *work, struct rays *rays, struct rays *other)
{
    size_t start[4], k;
    struct mark mark = arena_mark(&work->scratch);
    size_t found = independent(work, start);
    if (work->scratch.failed) return 0;
    if (found < 4) return -1;
    if (!begin_rays(work, rays, start)) return 0;
    arena_return(&work->scratch, mark);
    for (k = 0; k < work->n_rows; k++) {
        struct rays before;
        if (k == start[0] || k == start[1] || k == start[2] || k == start[3]) continue;
        before = *rays;
        if (!cut(work, &before, k, other)) return 0;
        *rays = *other;
        *other = before;
    }
    return 1;
}

/* Vertices (n, 3) rounded to doubles, and by how much they may be off. */
static double write_vertices(struct work *work, const struct rays *rays, double *vertices, size_t *n)
{
    double largest = 0.0, spacing;
    int exact = 1, k, exponent;
    size_t i;
    *n = 0;
    for (i = 0; i < rays->n; i++) {
        const struct row *ray = &rays->all[i].row;
        struct mark mark = arena_mark(&work->scratch);
        if (ray->at[3].sign <= 0) continue;
        for (k = 0; k < 3; k++) {
            double v = bigint_ratio(&work->scratch, ray->at[k], ray->at[3]);
            struct bigint back = bigint_product(&work->scratch, bigint_of(&work->scratch, v), ray->at[3]);
            exact = exact && bigint_equal(back, ray->at[k]);
            if (fabs(v) > largest) largest = fabs(v);
            vertices[3 * *n + k] = v;
        }
        ++*n;
        arena_return(&work->scratch, mark);
    }
    if (exact) return 0.0;
    /* Each coordinate is rounded to nearest: half a unit in the last place, and the smallest number there is. */
    frexp(largest, &exponent);
    spacing = exponent - 53 < -1074 ? ldexp(1.0, -1074) : ldexp(1.0, exponent - 53);
    return sqrt(3.0) * spacing / 2 * (1 + 1e-15);
}

/* The shape of the rays found. */
static collide_status shape_of_rays(struct work *work, const struct rays *rays, collide_shape **shape)
{
    collide_status status = COLLIDE_INVALID_SHAPE;
    double *vertices = malloc(3 * (rays->n + 1) * sizeof *vertices), slop;
    size_t n, k;
    int good = 1;
    if (vertices == NULL) return COLLIDE_NO_MEMORY;
    slop = write_vertices(work, rays, vertices, &n);
    for (k = 0; k < 3 * n; k++) good = good && fabs(vertices[k]) <= LARGEST;
    for (k = 0; n > 0 && k < rays->n; k++) good = good && rays->all[k].row.at[3].sign > 0; /* 0: a direction without end */
    if (work->scratch.failed) status = COLLIDE_NO_MEMORY;
    else if (n > 0 && good) status = shape_of_points(vertices, n, 0.0, slop, 0, shape);
    free(vertices);
    return status;
}

static collide_status polytope(const double *normals, const double *offsets, size_t m, collide_shape **shape)
{
    struct work work;
    struct rays rays = {NULL, 0, 0}, other = {NULL, 0, 0};
    collide_status status = COLLIDE_NO_MEMORY;
    arena_begin(&work.arena, NULL, 0);
    arena_begin(&work.scratch, NULL, 0);
    if (take_rows(&work, normals, offsets, m)) {
        int found = extreme_rays(&work, &rays, &other);
        if (found < 0) status = COLLIDE_INVALID_SHAPE;
        else if (found > 0) status = shape_of_rays(&work, &rays, shape);
    }
    free(rays.all);
    free(other.all);
    arena_end(&work.arena);
    arena_end(&work.scratch);
    return status;
}

collide_status collide_hpolytope(const double *normals, const double *offsets, size_t m, collide_shape **shape)
{
    collide_status status = COLLIDE_OK;
    size_t k;
    rounding given;
    if (shape == NULL) return COLLIDE_INVALID_ARGUMENT;
    *shape = NULL;
    if (normals == NULL || offsets == NULL) return COLLIDE_INVALID_ARGUMENT;
    if (m == 0 || m > (size_t)1 << 20) return COLLIDE_INVALID_SHAPE;
    given = round_as_kernels_do();
    for (k = 0; k < m; k++) {
        const double *n = normals + 3 * k;
        if (!(fabs(n[0]) <= LARGEST && fabs(n[1]) <= LARGEST && fabs(n[2]) <= LARGEST && fabs(offsets[k]) <= LARGEST) ||
            (n[0] == 0.0 && n[1] == 0.0 && n[2] == 0.0))
            status = COLLIDE_INVALID_SHAPE;
    }
    if (status == COLLIDE_OK) status = polytope(normals, offsets, m, shape);
    round_as_before(given);
    return status;
}
