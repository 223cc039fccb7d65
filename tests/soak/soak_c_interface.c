/* A seeded caller of every function of collide.h, from several threads that share shapes, sets, unions, meshes, fields, worlds and
   robots, each with workspaces of its own. `soak_c_interface.py` builds and runs it.

       soak_c_interface --calls N --seed S --threads T [--robots FILE]... [--repeat ROUND.THREAD.CALL]

   A round makes objects from (seed, round); call k of thread t draws its arguments from (seed, round, t, k). Every question is asked
   with two workspaces, of which the second is often a fresh one: statuses and bytes must be the same. Rows must be what the header
   says. A violation, or a fault that a sanitizer finds, ends the program with status 1 and names the call: --repeat makes the calls
   of its thread in its round up to it, alone. */
#include "collide.h"

#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef WITH_SOURCES
#include "capi_internal.h" /* kernels sign changed files of robots */
#endif

enum { SHAPES = 24, COMPOUNDS = 6, MESHES = 8, FIELDS = 6, ROBOTS = 4, WORLDS = 2, MOST = 6, ROWS = 64, MOST_THREADS = 16 };
enum { CALLS_A_ROUND = 3000, BYTES = ROWS * 200, GUARD = 64, STATUSES = COLLIDE_INVALID_FILE + 1 };

/* --- numbers --------------------------------------------------------------------------------------------------------- */

typedef uint64_t stream;

static uint64_t next(stream *s)
{
    uint64_t z = *s += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}
static stream stream_of(uint64_t a, uint64_t b, uint64_t c, uint64_t d)
{
    stream s = a;
    s = next(&s) ^ b;
    s = next(&s) ^ c;
    s = next(&s) ^ d;
    next(&s);
    return s;
}
static size_t below(stream *s, size_t n) { return (size_t)(next(s) % n); }
static int one_in(stream *s, size_t n) { return below(s, n) == 0; }
static double unit(stream *s) { return (double)(next(s) >> 11) * 0x1p-53; }
static double between(stream *s, double low, double high) { return low + (high - low) * unit(s); }

/* A number that few programs hand over. */
static double odd(stream *s)
{
    static const double known[] = {0.0, -0.0, 5e-324, -5e-324, 2.2250738585072014e-308, 1e-50, 1e50, -1e50, 1.7976931348623157e308,
                                   1e-51, 1.1e50, 1.0, -1.0, 1e-300, 1e-9, 1e9};
    size_t k = below(s, sizeof known / sizeof *known + 4);
    if (k == 0) return (double)NAN;
    if (k == 1) return (double)INFINITY;
    if (k == 2) return -(double)INFINITY;
    if (k == 3) return pow(10.0, between(s, -60, 60)) * (one_in(s, 2) ? 1 : -1);
    return known[k - 4];
}
/* A length of about a metre; now and then a coarse one, so that bodies touch, or an odd one. */
static double length(stream *s)
{
    if (one_in(s, 150)) return odd(s);
    return one_in(s, 3) ? 0.125 * (double)(1 + below(s, 8)) : between(s, 0.05, 1.0);
}
static double coordinate(stream *s, double size)
{
    if (one_in(s, 800)) return odd(s);
    return one_in(s, 3) ? size * 0.125 * ((double)below(s, 17) - 8) : between(s, -size, size);
}

/* A pose, or now and then a matrix that is none; *is_pose becomes 0 where a number is not finite. */
static void pose(stream *s, double *X, int *is_pose)
{
    double q[4], n = 0.0;
    int k;
    for (k = 0; k < 4; k++) q[k] = one_in(s, 3) ? (double)below(s, 2) : between(s, -1, 1);
    for (k = 0; k < 4; k++) n += q[k] * q[k];
    if (n == 0.0) q[0] = n = 1.0;
    for (k = 0; k < 4; k++) q[k] /= sqrt(n);
    X[0] = 1 - 2 * (q[2] * q[2] + q[3] * q[3]), X[1] = 2 * (q[1] * q[2] - q[0] * q[3]), X[2] = 2 * (q[1] * q[3] + q[0] * q[2]);
    X[4] = 2 * (q[1] * q[2] + q[0] * q[3]), X[5] = 1 - 2 * (q[1] * q[1] + q[3] * q[3]), X[6] = 2 * (q[2] * q[3] - q[0] * q[1]);
    X[8] = 2 * (q[1] * q[3] - q[0] * q[2]), X[9] = 2 * (q[2] * q[3] + q[0] * q[1]), X[10] = 1 - 2 * (q[1] * q[1] + q[2] * q[2]);
    for (k = 0; k < 3; k++) X[4 * k + 3] = one_in(s, 40) ? between(s, -1e3, 1e3) : coordinate(s, 1.0);
    X[12] = X[13] = X[14] = 0.0, X[15] = 1.0;
    if (one_in(s, 150)) X[below(s, 16)] = odd(s);
    for (k = 0; k < 16; k++) if (!isfinite(X[k])) *is_pose = 0;
}

/* --- what threads share ----------------------------------------------------------------------------------------------- */

struct shared {
    collide_shape *shapes[SHAPES];
    collide_shape_set *set;
    size_t n_set;
    collide_compound *compounds[COMPOUNDS];
    collide_mesh *meshes[MESHES];
    collide_field *fields[FIELDS];
    collide_world *worlds[WORLDS];
    collide_robot *robots[ROBOTS];
};

/* What one of two equal questions is answered with. */
struct reply {
    collide_status status, statuses[ROWS];
    unsigned char rows[BYTES + GUARD] __attribute__((aligned(64)));
    double doubles[4 * ROWS];
    size_t starts[ROWS + 1], count, failed;
    int hit;
};

struct caller {
    stream s;
    uint64_t seed, round, thread, call;
    const char *function; /* that is called now */
    const struct shared *shared;
    collide_workspace *spaces[2], *space;
    collide_robot_workspace *robot_spaces[2][ROBOTS], *robot_space;
    collide_world *world; /* that this thread alone changes */
    int32_t ids[512];
    size_t n_ids;
    struct reply replies[2], *reply;
    void *out; /* rows of the reply; NULL where there is no room for any */
    int is_bad; /* an argument is refused for certain */
    uint64_t calls, told[STATUSES], compared;
};

static struct caller *callers[MOST_THREADS];
static uint64_t seed = 1, only_round, only_thread, only_call;
static int repeats;

static void say_where(const struct caller *c)
{
    fprintf(stderr, "seed %llu, call %llu.%llu.%llu: %s (repeat: --seed %llu --repeat %llu.%llu.%llu)\n", (unsigned long long)c->seed,
            (unsigned long long)c->round, (unsigned long long)c->thread, (unsigned long long)c->call, c->function,
            (unsigned long long)c->seed, (unsigned long long)c->round, (unsigned long long)c->thread, (unsigned long long)c->call);
}
/* What all threads were about, where a sanitizer or a signal ends the program. */
static void say_all(void)
{
    int k;
    for (k = 0; k < MOST_THREADS; k++) if (callers[k] != NULL) say_where(callers[k]);
}
static void say_signal(int number)
{
    say_all();
    _Exit(128 + number);
}
static void violation(const struct caller *c, const char *what)
{
    fprintf(stderr, "VIOLATION: %s\n", what);
    say_where(c);
    exit(1);
}
#define EXPECT(condition, what)                 \
    do {                                        \
        if (!(condition)) violation(c, what);   \
    } while (0)

static void count_status(struct caller *c, collide_status status)
{
    EXPECT((unsigned)status < STATUSES, "a status that the header does not know");
    EXPECT(status != COLLIDE_NO_KERNELS && status != COLLIDE_NO_MEMORY, "no memory or no kernels");
    c->calls++;
    c->told[status]++;
}

/* --- things made ------------------------------------------------------------------------------------------------------ */

static collide_status make_shape(stream *s, collide_shape **shape)
{
    double numbers[3 * 300], offsets[20];
    size_t k, n;
    switch (below(s, 11)) {
    case 0: return collide_sphere(length(s), shape);
    case 1: case 2:
        for (k = 0; k < 3; k++) numbers[k] = length(s);
        return collide_box(numbers, shape);
    case 3: return collide_capsule(length(s), one_in(s, 9) ? 0.0 : length(s), shape);
    case 4: return collide_cylinder(length(s), length(s), shape);
    case 5: return collide_cone(length(s), length(s), shape);
    case 6:
        for (k = 0; k < 3; k++) numbers[k] = length(s);
        return collide_ellipsoid(numbers, shape);
    case 7:
        for (k = 0; k < 3; k++) numbers[k] = coordinate(s, 1.0);
        return collide_halfspace(numbers, coordinate(s, 1.0), shape);
    case 8: /* a box by its sides, and some that may cut it */
        for (k = 0; k < 60; k++) numbers[k] = k < 18 ? (k / 3 % 3 == k % 3 ? (k < 9 ? 1.0 : -1.0) : 0.0) : coordinate(s, 1.0);
        for (k = 0; k < 20; k++) offsets[k] = fabs(length(s));
        n = one_in(s, 20) ? below(s, 6) : 6 + below(s, 15);
        return collide_hpolytope(numbers, offsets, n, shape);
    default:
        n = one_in(s, 6) ? 224 + below(s, 77) : one_in(s, 4) ? 60 + below(s, 10) : below(s, 20);
        for (k = 0; k < 3 * n; k++) numbers[k] = n > 20 ? between(s, -0.5, 0.5) : coordinate(s, 0.5);
        if (n > 20 && one_in(s, 20)) numbers[below(s, 3 * n)] = odd(s);
        return collide_hull(numbers, n, one_in(s, 2) ? 0.0 : 0.1 * length(s), shape);
    }
}

static collide_status make_mesh(stream *s, const collide_shape *shape, collide_mesh **mesh)
{
    static const int32_t octahedron[24] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    double vertices[3 * 100];
    int32_t faces[3 * 200];
    size_t n, m, k, i;
    if (one_in(s, 4)) return collide_mesh_of_shape(shape, mesh);
    if (one_in(s, 4)) { /* terrain, some of it with holes */
        size_t columns = 1 + below(s, 9);
        double cell[2] = {0.5 * length(s), 0.5 * length(s)}, bottom = -coordinate(s, 2.0);
        n = one_in(s, 40) ? below(s, 3) : 2 + below(s, 9);
        for (k = 0; k < n * columns; k++) vertices[k] = one_in(s, 60) ? (double)NAN : coordinate(s, 0.4);
        return collide_height_field_create(vertices, n, columns, cell, one_in(s, 2) ? NULL : &bottom, mesh);
    }
    if (one_in(s, 2)) {
        for (k = 0; k < 18; k++) vertices[k] = k / 6 == k % 3 ? (k / 3 % 2 ? -1.0 : 1.0) * length(s) : 0.0;
        memcpy(faces, octahedron, sizeof octahedron);
        if (one_in(s, 10)) faces[below(s, 24)] = (int32_t)below(s, 8) - 1;
        return collide_mesh_create(vertices, 6, faces, 8 - one_in(s, 9), (int)below(s, one_in(s, 50) ? 5 : 3), mesh);
    }
    if (one_in(s, 2)) { /* a wavy sheet */
        for (k = 0; k < 100; k++) {
            vertices[3 * k] = 0.2 * (double)(k % 10) - 1, vertices[3 * k + 1] = 0.2 * (double)(k / 10) - 1;
            vertices[3 * k + 2] = between(s, -0.1, 0.1);
        }
        for (m = i = 0; i < 99; i++) {
            int32_t a = (int32_t)i;
            if (i % 10 == 9 || i >= 90) continue;
            faces[3 * m] = a, faces[3 * m + 1] = a + 1, faces[3 * m + 2] = a + 11, m++;
            faces[3 * m] = a, faces[3 * m + 1] = a + 11, faces[3 * m + 2] = a + 10, m++;
        }
        return collide_mesh_create(vertices, 100, faces, m, COLLIDE_SURFACE, mesh);
    }
    n = 1 + below(s, 30), m = below(s, 40);
    for (k = 0; k < 3 * n; k++) vertices[k] = coordinate(s, 0.7);
    for (k = 0; k < 3 * m; k++) faces[k] = (int32_t)(one_in(s, 1500) ? n : below(s, n));
    return collide_mesh_create(vertices, n, faces, m, one_in(s, 4) ? COLLIDE_SOLID_IF_CLOSED : COLLIDE_SURFACE, mesh);
}

static collide_status make_field(stream *s, collide_field **field)
{
    double points[3 * 200], radii[200], sides[3];
    uint8_t cells[1000];
    size_t n, k, along[3];
    if (one_in(s, 2)) {
        n = one_in(s, 60) ? 0 : 1 + below(s, 200);
        for (k = 0; k < 3 * n; k++) points[k] = one_in(s, 10) ? coordinate(s, 0.7) : between(s, -0.7, 0.7);
        for (k = 0; k < n; k++) radii[k] = one_in(s, 4) ? 0.0 : between(s, 0.0, 0.1);
        if (one_in(s, 30)) radii[below(s, 200)] = odd(s);
        return collide_point_cloud_create(points, n, radii, one_in(s, 2) ? 1 : one_in(s, 50) ? 2 : n, field);
    }
    for (k = 0; k < 3; k++) along[k] = one_in(s, 60) ? 0 : 1 + below(s, 10), sides[k] = 0.2 * length(s);
    for (k = 0; k < 1000; k++) cells[k] = one_in(s, 5) ? (uint8_t)(1 + below(s, 255)) : 0;
    for (k = 0; k < 3; k++) points[k] = coordinate(s, 0.5);
    return collide_voxel_grid_create(cells, along, sides, one_in(s, 3) ? NULL : points, field);
}

static collide_status make_compound(stream *s, collide_shape *const *shapes, size_t n_shapes, collide_compound **compound)
{
    const collide_shape *parts[40];
    double poses[16 * 40];
    size_t n = one_in(s, 40) ? 0 : one_in(s, 5) ? 10 + below(s, 30) : 1 + below(s, MOST), k;
    int ignored;
    for (k = 0; k < n; k++) {
        parts[k] = shapes[below(s, n_shapes)];
        pose(s, poses + 16 * k, &ignored);
    }
    if (n > 0 && one_in(s, 60)) parts[below(s, n)] = NULL;
    return collide_compound_create(parts, poses, n, compound);
}

static collide_body a_body(stream *s, const struct shared *o, double *X)
{
    collide_body body = COLLIDE_BODY_DEFAULT;
    int ignored;
    size_t kind = below(s, 12);
    if (kind < 9) body.shape = o->shapes[below(s, SHAPES)];
    else if (kind < 11) body.mesh = o->meshes[below(s, MESHES)];
    else body.field = o->fields[below(s, FIELDS)];
    pose(s, X, &ignored);
    for (kind = 0; kind < 3; kind++) X[4 * kind + 3] *= 3;
    body.X_WB = one_in(s, 12) ? NULL : X;
    body.is_static = one_in(s, 6);
    if (one_in(s, 5)) body.group = 1u << below(s, 5), body.mask = (uint32_t)next(s);
    if (one_in(s, 100)) body.size = below(s, 200);
    if (one_in(s, 100)) body.shape = o->shapes[0];
    return body;
}

/* A file of a robot, some of its bytes changed, and signed anew where kernels are at hand. */
static struct { const char *path; unsigned char *bytes; size_t n; } files[16];
static size_t n_files;

static collide_status make_robot(stream *s, collide_robot **robot)
{
    size_t k = below(s, n_files), n = files[k].n, changes = one_in(s, 3) ? 0 : 1 + below(s, 4), i;
    unsigned char *bytes = malloc(n + 8); /* its end is where a sanitizer sees it */
    collide_status status;
    memcpy(bytes, files[k].bytes, n);
    for (i = 0; i < changes; i++) {
        size_t at = 8 * below(s, one_in(s, 2) && n > 2048 ? 256 : n / 8);
        int64_t word = (int64_t)below(s, 3) - 1;
        double number = odd(s);
        if (one_in(s, 3)) bytes[at + below(s, 8)] ^= (unsigned char)(1u << below(s, 8));
        else if (one_in(s, 2)) memcpy(bytes + at, &word, 8);
        else memcpy(bytes + at, &number, 8);
    }
    if (changes > 0 && one_in(s, 10)) n = below(s, n);
#ifdef WITH_SOURCES
    enum { DIGEST_AT = 24, SIGNED_AT = 40 }; /* as capi_robot_file.c has them */
    if (n % 8 == 0 && n > SIGNED_AT && kernels_here() != NULL) {
        int64_t memory[DIGEST_WORDS], signature[2];
        kernels_here()->digest_numbers(address_of(bytes + SIGNED_AT), (int64_t)((n - SIGNED_AT) / 8), 0, 0, 0, 0,
                                       address_of(memory), address_of(signature));
        memcpy(bytes + DIGEST_AT, signature, sizeof signature);
    }
#endif
    status = collide_robot_read(bytes, n, robot);
    free(bytes);
    return status;
}

static void make_shared(struct shared *o, uint64_t round)
{
    stream drawn = stream_of(seed, round, 1000, 0), *s = &drawn;
    size_t k, i;
    memset(o, 0, sizeof *o);
    for (k = 0; k < SHAPES; k++) while (make_shape(s, &o->shapes[k]) != COLLIDE_OK) continue;
    if (one_in(s, 2)) collide_shape_free(o->shapes[1]), o->shapes[1] = o->shapes[0]; /* the same one twice */
    o->n_set = 1 + below(s, SHAPES);
    if (collide_shape_set_create((const collide_shape *const *)o->shapes, o->n_set, &o->set) != COLLIDE_OK) abort();
    for (k = 0; k < COMPOUNDS; k++) while (make_compound(s, o->shapes, SHAPES, &o->compounds[k]) != COLLIDE_OK) continue;
    for (k = 0; k < MESHES; k++) while (make_mesh(s, o->shapes[below(s, SHAPES)], &o->meshes[k]) != COLLIDE_OK) continue;
    for (k = 0; k < FIELDS; k++) while (make_field(s, &o->fields[k]) != COLLIDE_OK) continue;
    for (k = 0; k < ROBOTS && n_files > 0; k++) while (make_robot(s, &o->robots[k]) != COLLIDE_OK) continue;
    for (k = 0; k < WORLDS; k++) {
        size_t n = k == 0 ? below(s, 12) : 12 + below(s, 60);
        if (collide_world_create(&o->worlds[k]) != COLLIDE_OK) abort();
        for (i = 0; i < n; i++) {
            double X[16];
            collide_body body = a_body(s, o, X);
            int32_t id;
            (void)collide_world_add(o->worlds[k], &body, 1, &id);
        }
    }
}

/* Frees all, in one of the orders allowed: what is made of shapes before these. */
static void free_shared(struct shared *o, stream *s)
{
    size_t k, last = o->shapes[1] == o->shapes[0], order = below(s, SHAPES);
    for (k = 0; k < WORLDS; k++) collide_world_free(o->worlds[k]);
    for (k = 0; k < COMPOUNDS; k++) collide_compound_free(o->compounds[(k + order) % COMPOUNDS]);
    collide_shape_set_free(o->set);
    for (k = 0; k < SHAPES; k++) if (!last || (k + order) % SHAPES != 1) collide_shape_free(o->shapes[(k + order) % SHAPES]);
    for (k = 0; k < MESHES; k++) collide_mesh_free(o->meshes[(k + order) % MESHES]);
    for (k = 0; k < FIELDS; k++) collide_field_free(o->fields[k]);
    for (k = 0; k < ROBOTS; k++) collide_robot_free(o->robots[k]);
}

/* --- questions -------------------------------------------------------------------------------------------------------- */

static const void *handle(struct caller *c, const void *one)
{
    if (!one_in(&c->s, 300)) return one;
    c->is_bad = 1;
    return NULL;
}
#define A_SHAPE(c) ((const collide_shape *)handle(c, (c)->shared->shapes[below(&(c)->s, SHAPES)]))
#define A_COMPOUND(c) ((const collide_compound *)handle(c, (c)->shared->compounds[below(&(c)->s, COMPOUNDS)]))
#define A_MESH(c) ((const collide_mesh *)handle(c, (c)->shared->meshes[below(&(c)->s, MESHES)]))
#define A_FIELD(c) ((const collide_field *)handle(c, (c)->shared->fields[below(&(c)->s, FIELDS)]))

static void a_pose(struct caller *c, double *X)
{
    int is_pose = 1;
    pose(&c->s, X, &is_pose);
    if (!is_pose) c->is_bad = 1;
}
/* n or 1 poses; now and then another count, or none. */
static collide_poses some_poses(struct caller *c, double *X, size_t n)
{
    collide_poses poses;
    size_t k;
    poses.matrices = X;
    poses.count = one_in(&c->s, 4) ? 1 : one_in(&c->s, 300) ? 0 : one_in(&c->s, 300) && n > 2 ? n - 1 : n;
    for (k = 0; k == 0 || k < poses.count; k++) a_pose(c, X + 16 * k);
    return poses;
}
static collide_vectors some_vectors(struct caller *c, double *xyz, size_t n)
{
    collide_vectors vectors;
    size_t k;
    vectors.xyz = xyz;
    vectors.count = one_in(&c->s, 4) ? 1 : n;
    for (k = 0; k < 3 * n; k++) xyz[k] = coordinate(&c->s, 1.5);
    if (one_in(&c->s, 300)) vectors.count = 0;
    return vectors;
}
/* How many questions two batches make. */
static size_t longest(size_t n, size_t m) { return n == 0 || m == 0 ? 0 : n > m ? n : m; }
static unsigned flags_of(struct caller *c) { return one_in(&c->s, 60) ? (unsigned)next(&c->s) : (unsigned)below(&c->s, 2); }
static unsigned flags_and(struct caller *c, unsigned more) { return flags_of(c) | (one_in(&c->s, 3) ? more : 0); }
static double limit_of(struct caller *c)
{
    double limit = one_in(&c->s, 3) ? (double)INFINITY : one_in(&c->s, 4) ? 0.0 : one_in(&c->s, 60) ? odd(&c->s) : unit(&c->s);
    if (isnan(limit) || limit < 0.0) c->is_bad = 1;
    return limit;
}
/* A margin, and how many rows there is room for. */
static double margin_of(struct caller *c)
{
    return one_in(&c->s, 3) ? 0.0 : one_in(&c->s, 60) ? odd(&c->s) : between(&c->s, 0.0, 0.3);
}
static size_t capacity_of(struct caller *c) { return one_in(&c->s, 4) ? below(&c->s, 4) : below(&c->s, ROWS + 1); }

/* Whether two equal questions are answered alike, in rows that end where `room` bytes do. */
static void compare(struct caller *c, size_t room, int is_bad)
{
    const struct reply *a = &c->replies[0], *b = &c->replies[1];
    size_t k;
    for (k = room; k < room + GUARD; k++)
        EXPECT(a->rows[k] == 0xA5 && b->rows[k] == 0x5A, "bytes behind the caller's room were written to");
    EXPECT(a->status == b->status, "an equal question has another status");
    if (is_bad) EXPECT(a->status != COLLIDE_OK, "an argument that must be refused was not");
    c->compared++;
}
static void same_bytes(struct caller *c, size_t bytes)
{
    EXPECT(memcmp(c->replies[0].rows, c->replies[1].rows, bytes) == 0, "an equal question has other rows");
}
#define ASK(c, room, expression)                                                                       \
    do {                                                                                               \
        size_t side_, room_ = (room);                                                                  \
        int no_space_ = one_in(&(c)->s, 300);                                                          \
        for (side_ = 0; side_ < 2; side_++) {                                                          \
            struct reply *r = (c)->reply = &(c)->replies[side_];                                       \
            memset(r, side_ ? 0x5A : 0xA5, offsetof(struct reply, rows) + room_ + GUARD);              \
            (c)->out = room_ > 0 ? r->rows : NULL, r->count = r->failed = 12345, r->hit = 7;           \
            (c)->space = no_space_ ? NULL : (c)->spaces[side_];                                        \
            (c)->function = #expression;                                                               \
            r->status = (expression);                                                                  \
            count_status(c, r->status);                                                                \
        }                                                                                              \
        compare(c, room_, (c)->is_bad || no_space_);                                                   \
    } while (0)
#define OK_OR(c, other) ((c)->replies[0].status == COLLIDE_OK || (c)->replies[0].status == (other))
#define IS_OK(c) ((c)->replies[0].status == COLLIDE_OK)

static int is_unit(const double *v) { return fabs(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - 1) < 1e-9; }
static int is_zero(const double *v) { return v[0] == 0.0 && v[1] == 0.0 && v[2] == 0.0; }

/* What the header says of every row of a pair. */
static void check_pair(struct caller *c, const collide_pair *row)
{
    if (c->is_bad && !row->certified && row->lower != row->lower) return; /* a half-space in a singular matrix that is trusted */
    EXPECT(row->lower <= row->distance && row->distance <= row->upper, "a distance outside its bracket");
    EXPECT(row->hit <= 1 && row->certified <= 1 && row->beyond <= 1, "a flag that is neither 0 nor 1");
    EXPECT(row->how >= 0 && row->how <= COLLIDE_HOW_EXACT_ARITHMETIC, "an unknown `how`");
    if (row->hit && row->beyond)
        fprintf(stderr, "distance %g, %g to %g, certified %d, how %d, parts %d %d\n", row->distance, row->lower, row->upper,
                row->certified, (int)row->how, (int)row->part_a, (int)row->part_b);
    EXPECT(!(row->hit && row->beyond), "a pair that hits and is beyond");
    EXPECT(row->hit || row->lower >= 0.0, "a pair that does not hit, but may be below 0");
    EXPECT(!row->hit || row->lower <= 0.0, "a pair that hits, but is proven apart");
    EXPECT(!row->beyond || row->upper == (double)INFINITY, "beyond, with an upper bound");
    EXPECT(is_unit(row->normal) || is_zero(row->normal), "a normal that is neither of length 1 nor zero");
}
static void check_contact(struct caller *c, const collide_contact *row)
{
    EXPECT(row->lower <= row->distance && row->distance <= row->upper, "a contact's distance outside its bracket");
    EXPECT(is_unit(row->normal), "a contact's normal is not of length 1");
    EXPECT(row->kind == COLLIDE_CONTACT_GAP || row->kind == COLLIDE_CONTACT_OVERLAP, "an unknown kind of contact");
}
/* Rows as many as were counted, or as there was room for. */
static size_t rows_written(struct caller *c, size_t capacity)
{
    const struct reply *a = &c->replies[0], *b = &c->replies[1];
    if (!OK_OR(c, COLLIDE_TOO_MANY)) return 0;
    EXPECT(a->count == b->count, "an equal question counts otherwise");
    if (a->status == COLLIDE_OK) EXPECT(a->count <= capacity, "more rows than there is room for, and COLLIDE_OK");
    else EXPECT(a->count > capacity, "COLLIDE_TOO_MANY, and fewer rows than there is room for");
    return a->count < capacity ? a->count : capacity;
}
static void check_pairs(struct caller *c, size_t n)
{
    size_t k;
    same_bytes(c, n * sizeof(collide_pair));
    for (k = 0; k < n; k++) check_pair(c, (const collide_pair *)(const void *)c->replies[0].rows + k);
}
static void check_contacts(struct caller *c, size_t n)
{
    size_t k;
    same_bytes(c, n * sizeof(collide_contact));
    for (k = 0; k < n; k++) check_contact(c, (const collide_contact *)(const void *)c->replies[0].rows + k);
}
static void check_hit(struct caller *c)
{
    if (!IS_OK(c)) return;
    EXPECT(c->replies[0].hit == c->replies[1].hit, "an equal question has another hit");
    EXPECT(c->replies[0].hit == 0 || c->replies[0].hit == 1, "a hit that is neither 0 nor 1");
}
static void check_hits(struct caller *c, size_t n)
{
    size_t k;
    if (!IS_OK(c)) return;
    same_bytes(c, n);
    for (k = 0; k < n; k++) EXPECT(c->replies[0].rows[k] <= 1, "a hit that is neither 0 nor 1");
}
static void check_failed(struct caller *c, size_t n)
{
    EXPECT(c->replies[0].failed == c->replies[1].failed, "an equal question fails elsewhere");
    EXPECT(IS_OK(c) || c->replies[0].failed == 12345 || c->replies[0].failed <= n, "*failed is no number of a pair");
}
/* What a pair's signed distance has to do with its boolean, its margin and its mirror. */
#define ROW ((collide_pair *)c->out)
#define CONTACTS ((collide_contact *)c->out)

static void ask_pair(struct caller *c)
{
    const collide_shape *A = A_SHAPE(c), *B = A_SHAPE(c);
    double X[16], Y[16], limit;
    unsigned flags = flags_of(c);
    collide_pair row;
    int hit;
    a_pose(c, X), a_pose(c, Y);
    ASK(c, 0, collide_collide(c->space, A, B, X, Y, flags, &c->reply->hit));
    check_hit(c);
    if (!IS_OK(c)) return;
    hit = c->replies[0].hit, limit = limit_of(c);
    ASK(c, sizeof row, collide_distance(c->space, A, B, X, Y, limit, flags, ROW));
    if (!OK_OR(c, COLLIDE_ENDLESS_DEPTH)) return;
    if (IS_OK(c)) check_pairs(c, 1);
    memcpy(&row, c->replies[0].rows, sizeof row);
    EXPECT(row.hit == hit, "boolean and distance contradict each other");
    ASK(c, sizeof row, collide_distance(c->space, B, A, Y, X, limit, flags, ROW));
    if (!IS_OK(c)) return;
    EXPECT(memcmp(&row, c->replies[0].rows, 3 * sizeof(double)) == 0, "the exchanged pair has another bracket");
}

static void ask_unsigned(struct caller *c)
{
    const collide_shape *A = A_SHAPE(c), *B = A_SHAPE(c);
    double X[16], Y[16], limit = limit_of(c);
    unsigned flags = flags_and(c, COLLIDE_UNSIGNED);
    a_pose(c, X), a_pose(c, Y);
    ASK(c, sizeof(collide_pair), collide_distance(c->space, A, B, X, Y, limit, flags, ROW));
    if (IS_OK(c)) {
        same_bytes(c, sizeof(collide_pair));
        if (flags & COLLIDE_UNSIGNED) EXPECT(((collide_pair *)(void *)c->replies[0].rows)->distance >= 0.0, "a gap below 0");
    }
}

static void ask_batch(struct caller *c)
{
    const collide_shape *A = A_SHAPE(c), *B = A_SHAPE(c);
    double X[16 * ROWS], Y[16 * ROWS], limit, axes[3 * ROWS];
    size_t n = 1 + below(&c->s, one_in(&c->s, 4) ? ROWS : 5), k, both;
    collide_poses Xs = some_poses(c, X, n), Ys = some_poses(c, Y, n);
    unsigned flags = flags_of(c), with_axes = one_in(&c->s, 3);
    both = longest(Xs.count, Ys.count);
    if (both == 0) c->is_bad = 0; /* nothing is asked */
    if (one_in(&c->s, 2)) {
        if (both > 0 && Xs.count != Ys.count && Xs.count != 1 && Ys.count != 1) c->is_bad = 1;
        for (k = 0; k < 3 * n; k++) axes[k] = one_in(&c->s, 3) ? 0.0 : coordinate(&c->s, 1.0);
        ASK(c, both, (memcpy(c->reply->doubles, axes, sizeof axes),
                      collide_collide_batch(c->space, A, B, Xs, Ys, flags, with_axes ? c->reply->doubles : NULL, c->out,
                                            &c->reply->failed)));
        check_hits(c, both);
    } else {
        limit = limit_of(c);
        ASK(c, both * sizeof(collide_pair), collide_distance_batch(c->space, A, B, Xs, Ys, limit, flags, ROW, &c->reply->failed));
        if (IS_OK(c) && both > 0) {
            size_t j = below(&c->s, both);
            collide_pair row;
            check_pairs(c, both);
            memcpy(&row, (collide_pair *)(void *)c->replies[0].rows + j, sizeof row);
            ASK(c, sizeof row, collide_distance(c->space, A, B, Xs.matrices + (Xs.count > 1 ? 16 * j : 0),
                                                Ys.matrices + (Ys.count > 1 ? 16 * j : 0), limit, flags, ROW));
            if (IS_OK(c)) EXPECT(memcmp(&row, c->replies[0].rows, sizeof row) == 0, "a row of a batch is not the single call's");
            return;
        }
    }
    check_failed(c, both);
}

static void ask_each(struct caller *c)
{
    size_t n = 1 + below(&c->s, ROWS), k, capacity = capacity_of(c), most = 1 + below(&c->s, 10);
    int64_t which[2 * ROWS];
    double X[16 * ROWS], Y[16 * ROWS], limit, margin = margin_of(c);
    collide_poses Xs = some_poses(c, X, n), Ys = some_poses(c, Y, n);
    const collide_shape_set *set = handle(c, c->shared->set);
    unsigned flags = flags_of(c);
    for (k = 0; k < 2 * n; k++) which[k] = (int64_t)below(&c->s, c->shared->n_set);
    if (one_in(&c->s, 100)) which[below(&c->s, 2 * n)] = one_in(&c->s, 2) ? -1 : (int64_t)c->shared->n_set, c->is_bad = 1;
    switch (below(&c->s, 3)) {
    case 0:
        ASK(c, n, collide_collide_each(c->space, set, which, n, Xs, Ys, flags, NULL, c->out, &c->reply->failed));
        check_hits(c, n);
        break;
    case 1:
        limit = limit_of(c);
        ASK(c, n * sizeof(collide_pair),
            collide_distance_each(c->space, set, which, n, Xs, Ys, limit, flags, ROW, &c->reply->failed));
        if (IS_OK(c)) check_pairs(c, n);
        break;
    default:
        c->is_bad = 0; /* a pair before the bad one may be told first */
        ASK(c, capacity * sizeof(collide_contact),
            collide_contacts_each(c->space, set, which, n, Xs, Ys, margin, most, flags, CONTACTS, capacity, c->reply->starts,
                                  &c->reply->failed));
        if (IS_OK(c)) {
            EXPECT(c->replies[0].starts[n] <= capacity, "more contacts than there is room for");
            check_contacts(c, c->replies[0].starts[n]);
        }
    }
    check_failed(c, n);
}

static void ask_within(struct caller *c)
{
    const collide_shape *A = A_SHAPE(c), *B = A_SHAPE(c);
    size_t n = 1 + below(&c->s, 6), both;
    double X[16 * 6], Y[16 * 6], margin = margin_of(c);
    collide_poses Xs = some_poses(c, X, n), Ys = some_poses(c, Y, n);
    unsigned flags = flags_of(c);
    both = longest(Xs.count, Ys.count);
    if (both == 0) c->is_bad = 0; /* nothing is asked */
    ASK(c, both, collide_within(c->space, A, B, Xs, Ys, margin, flags, c->out, &c->reply->failed));
    check_hits(c, both);
    check_failed(c, both);
    if (IS_OK(c) && both > 0) {
        int within = c->replies[0].rows[0];
        const collide_pair *row = (const collide_pair *)(const void *)c->replies[0].rows;
        ASK(c, sizeof *row, collide_distance(c->space, A, B, X, Y, (double)INFINITY, flags, ROW));
        if (!IS_OK(c)) return;
        EXPECT(within || row->upper > margin, "not within a margin, but proven to be");
        EXPECT(!within || row->lower <= margin, "within a margin, but proven farther apart");
    }
}

static void ask_contacts(struct caller *c)
{
    const collide_shape *A = A_SHAPE(c), *B = A_SHAPE(c);
    double X[16 * 6], Y[16 * 6], margin = margin_of(c);
    size_t most = one_in(&c->s, 40) ? 0 : 1 + below(&c->s, 12), n = 1 + below(&c->s, 6), capacity = capacity_of(c), both;
    unsigned flags = flags_of(c);
    collide_poses Xs = some_poses(c, X, n), Ys = some_poses(c, Y, n);
    both = longest(Xs.count, Ys.count);
    if (both == 0) c->is_bad = 0; /* nothing is asked */
    if (one_in(&c->s, 2)) {
        c->is_bad = 0;
        ASK(c, most * sizeof(collide_contact), collide_contacts(c->space, A, B, X, Y, margin, most, flags, CONTACTS, &c->reply->count));
        check_contacts(c, rows_written(c, most));
    } else {
        ASK(c, capacity * sizeof(collide_contact), collide_contacts_batch(c->space, A, B, Xs, Ys, margin, most, flags, CONTACTS,
                                                                          capacity, c->reply->starts, &c->reply->failed));
        check_failed(c, both);
        if (IS_OK(c)) {
            EXPECT(c->replies[0].starts[both] <= capacity, "more contacts than there is room for");
            check_contacts(c, c->replies[0].starts[both]);
        }
    }
}

static void check_cast(struct caller *c, size_t n)
{
    size_t k;
    same_bytes(c, n * sizeof(collide_first_contact));
    for (k = 0; k < n; k++) {
        const collide_first_contact *row = (const collide_first_contact *)(const void *)c->replies[0].rows + k;
        if (c->replies[0].status != COLLIDE_OK) continue;
        EXPECT(row->lower <= row->distance && row->distance <= row->upper, "a cast's distance outside its bracket");
        EXPECT(row->hit <= 1 && row->certified <= 1 && row->at_start <= 1, "a flag that is neither 0 nor 1");
        EXPECT(row->hit || row->distance == (double)INFINITY, "a cast that misses, and has a distance");
    }
}
static void ask_cast(struct caller *c)
{
    const collide_shape *A = A_SHAPE(c), *B = A_SHAPE(c);
    const collide_compound *C = A_COMPOUND(c), *D = A_COMPOUND(c);
    const collide_field *F = A_FIELD(c);
    double X[16 * 6], Y[16 * 6], v[18], limit = limit_of(c);
    size_t n = 1 + below(&c->s, 6), most;
    collide_poses Xs = some_poses(c, X, n), Ys = some_poses(c, Y, n);
    collide_vectors vs = some_vectors(c, v, n);
    unsigned flags = flags_and(c, COLLIDE_START_NORMALS);
    most = longest(longest(Xs.count, Ys.count), vs.count);
    c->is_bad = 0; /* handles of other calls */
    switch (below(&c->s, 4)) {
    case 0:
        ASK(c, sizeof(collide_first_contact), collide_cast(c->space, A, B, X, Y, v, limit, flags, c->out));
        if (IS_OK(c)) check_cast(c, 1);
        break;
    case 1:
        ASK(c, most * sizeof(collide_first_contact),
            collide_cast_batch(c->space, A, B, Xs, Ys, vs, limit, flags, c->out, c->reply->statuses,
                               &c->reply->failed));
        if (IS_OK(c)) check_cast(c, most);
        check_failed(c, most);
        break;
    case 2:
        ASK(c, sizeof(collide_first_contact), collide_field_cast(c->space, A, F, X, Y, v, limit, flags & 1, c->out));
        if (IS_OK(c)) check_cast(c, 1);
        break;
    default:
        ASK(c, sizeof(collide_first_contact), collide_compound_cast(c->space, C, D, X, Y, v, limit, flags, c->out));
        if (IS_OK(c)) check_cast(c, 1);
    }
}

static void ask_impact(struct caller *c)
{
    const collide_shape *A = A_SHAPE(c), *B = A_SHAPE(c);
    double X[4][16 * 3], tolerance = one_in(&c->s, 60) ? odd(&c->s) : pow(10.0, between(&c->s, -8, -1)), omega[9];
    size_t n = 1 + below(&c->s, 3), most, k;
    collide_motions m;
    unsigned flags = flags_of(c);
    memset(X, 0, sizeof X);
    m.X_WA0 = some_poses(c, X[0], n), m.X_WA1 = some_poses(c, X[1], n);
    m.X_WB0 = some_poses(c, X[2], n);
    if (one_in(&c->s, 3)) memcpy(X[3], X[2], sizeof X[3]), m.X_WB1 = m.X_WB0, m.X_WB1.matrices = X[3];
    else m.X_WB1 = some_poses(c, X[3], n);
    m.omega_WA = some_vectors(c, omega, n), m.omega_WB.xyz = NULL, m.omega_WB.count = 0;
    if (!one_in(&c->s, 5)) m.omega_WA = m.omega_WB;
    most = longest(longest(m.X_WA0.count, m.X_WA1.count), longest(m.X_WB0.count, m.X_WB1.count));
    if (m.omega_WA.xyz != NULL) most = longest(most, m.omega_WA.count);
    if (most == 0) c->is_bad = 0; /* nothing is asked */
    if (one_in(&c->s, 2)) {
        most = 1, c->is_bad = 0; /* poses of other motions */
        ASK(c, sizeof(collide_time_of_impact), collide_impact(c->space, A, B, X[0], X[1], X[2], X[3], m.omega_WA.xyz, NULL, tolerance,
                                                              flags, c->out));
    } else {
        ASK(c, most * sizeof(collide_time_of_impact),
            collide_impact_batch(c->space, A, B, &m, tolerance, flags, c->out, c->reply->statuses,
                                 &c->reply->failed));
        check_failed(c, most);
    }
    if (!IS_OK(c)) return;
    same_bytes(c, most * sizeof(collide_time_of_impact));
    for (k = 0; k < most; k++) {
        const collide_time_of_impact *row = (const collide_time_of_impact *)(const void *)c->replies[0].rows + k;
        EXPECT(row->lower >= 0.0 && row->lower <= row->upper && row->time >= row->lower && row->time <= 1.0, "a time outside [0, 1]");
        EXPECT(row->hit <= 1 && row->certified <= 1, "a flag that is neither 0 nor 1");
    }
}

static void ask_compounds(struct caller *c)
{
    collide_compound *made = NULL;
    const collide_compound *A, *B = A_COMPOUND(c);
    double X[16 * 6], Y[16 * 6], limit, margin = margin_of(c);
    size_t n = 1 + below(&c->s, 6), both, capacity = capacity_of(c), most = 1 + below(&c->s, 10);
    collide_poses Xs = some_poses(c, X, n), Ys = some_poses(c, Y, n);
    unsigned flags = flags_of(c);
    both = longest(Xs.count, Ys.count);
    if (both == 0) c->is_bad = 0; /* nothing is asked */
    if (one_in(&c->s, 4)) { /* one made where another was freed */
        count_status(c, make_compound(&c->s, c->shared->shapes, SHAPES, &made));
        A = made;
        if (made == NULL) c->is_bad = 1;
    } else A = A_COMPOUND(c);
    switch (below(&c->s, 3)) {
    case 0:
        ASK(c, both, collide_compound_collide(c->space, A, B, Xs, Ys, flags, c->out, &c->reply->failed));
        check_hits(c, both);
        check_failed(c, both);
        break;
    case 1:
        limit = limit_of(c);
        ASK(c, both * sizeof(collide_pair),
            collide_compound_distance(c->space, A, B, Xs, Ys, limit, flags, ROW, &c->reply->failed));
        if (IS_OK(c)) check_pairs(c, both);
        check_failed(c, both);
        break;
    default:
        c->is_bad = 0;
        ASK(c, capacity * sizeof(collide_contact), collide_compound_contacts(c->space, A, B, X, Y, margin, most, flags, CONTACTS,
                                                                             capacity, &c->reply->count));
        check_contacts(c, rows_written(c, capacity));
    }
    collide_compound_free(made);
}

static void ask_meshes(struct caller *c)
{
    const collide_mesh *M = A_MESH(c), *N = A_MESH(c);
    const collide_shape *S = A_SHAPE(c);
    double X[16], Y[16], margin = margin_of(c);
    size_t capacity = capacity_of(c), most = 1 + below(&c->s, 10);
    unsigned flags = flags_and(c, COLLIDE_UNSIGNED);
    a_pose(c, X), a_pose(c, Y);
    c->is_bad = 0;
    switch (below(&c->s, 6)) {
    case 0: ASK(c, 0, collide_mesh_collide(c->space, M, N, X, Y, flags, &c->reply->hit)); check_hit(c); return;
    case 1: ASK(c, 0, collide_mesh_shape_collide(c->space, M, S, X, Y, flags, &c->reply->hit)); check_hit(c); return;
    case 2: ASK(c, sizeof(collide_pair), collide_mesh_distance(c->space, M, N, X, Y, flags, ROW)); break;
    case 3: ASK(c, sizeof(collide_pair), collide_mesh_shape_distance(c->space, M, S, X, Y, flags, ROW)); break;
    case 4:
        ASK(c, capacity * sizeof(collide_contact), collide_mesh_contacts(c->space, M, N, X, Y, margin, most, flags & 1, CONTACTS,
                                                                         capacity, &c->reply->count));
        check_contacts(c, rows_written(c, capacity));
        return;
    default:
        ASK(c, capacity * sizeof(collide_contact), collide_mesh_shape_contacts(c->space, M, S, X, Y, margin, most, flags & 1,
                                                                               CONTACTS, capacity, &c->reply->count));
        check_contacts(c, rows_written(c, capacity));
        return;
    }
    if (IS_OK(c)) check_pairs(c, 1);
}

static void ask_rays(struct caller *c)
{
    const collide_shape *A = A_SHAPE(c);
    const collide_compound *C = A_COMPOUND(c);
    const collide_mesh *M = A_MESH(c);
    const collide_field *F = A_FIELD(c);
    double X[16 * 6], o[18], d[18], limit = limit_of(c);
    size_t n = 1 + below(&c->s, 6), most, k;
    collide_poses Xs = some_poses(c, X, n);
    collide_vectors os = some_vectors(c, o, n), ds = some_vectors(c, d, n);
    unsigned flags = flags_of(c);
    most = longest(longest(Xs.count, os.count), ds.count);
    c->is_bad = 0;
    switch (below(&c->s, 4)) {
    case 2: ASK(c, most * sizeof(collide_ray_hit),
                collide_field_raycast(c->space, F, Xs, os, ds, limit, flags, c->out, c->reply->statuses,
                                      &c->reply->failed)); break;
    case 0: ASK(c, most * sizeof(collide_ray_hit), collide_raycast(c->space, A, Xs, os, ds, limit, flags, c->out,
                                                                   c->reply->statuses, &c->reply->failed)); break;
    case 1: ASK(c, most * sizeof(collide_ray_hit),
                collide_compound_raycast(c->space, C, Xs, os, ds, limit, flags, c->out, c->reply->statuses,
                                         &c->reply->failed)); break;
    default: ASK(c, most * sizeof(collide_ray_hit),
                 collide_mesh_raycast(c->space, M, Xs, os, ds, limit, flags, c->out, c->reply->statuses,
                                      &c->reply->failed));
    }
    check_failed(c, most);
    if (!IS_OK(c)) return;
    same_bytes(c, most * sizeof(collide_ray_hit));
    for (k = 0; k < most; k++) {
        const collide_ray_hit *row = (const collide_ray_hit *)(const void *)c->replies[0].rows + k;
        EXPECT(c->replies[0].statuses[k] == COLLIDE_OK, "all is answered, but for the status of a ray");
        EXPECT(row->lower <= row->distance && row->distance <= row->upper, "a ray's distance outside its bracket");
        EXPECT(row->hit || (row->distance == (double)INFINITY && row->facet == -1), "a ray that misses, and has a distance");
    }
}

static void ask_fields(struct caller *c)
{
    const collide_field *F = A_FIELD(c);
    const collide_shape *S = A_SHAPE(c);
    double X[16 * 6], Y[16 * 6], limit = limit_of(c), margin = margin_of(c), places[18];
    size_t n = 1 + below(&c->s, 6), most = 1 + below(&c->s, 10), both, k = 1 + below(&c->s, 9), capacity = capacity_of(c), i;
    collide_poses Xs = some_poses(c, X, n), Ys = some_poses(c, Y, n);
    unsigned flags = flags_and(c, COLLIDE_UNSIGNED);
    both = longest(Xs.count, Ys.count);
    if (both == 0) c->is_bad = 0; /* nothing is asked */
    for (i = 0; i < 18; i++) places[i] = coordinate(&c->s, 1.0);
    c->is_bad = 0;
    switch (below(&c->s, 7)) {
    case 0: ASK(c, 0, collide_field_collide(c->space, F, S, X, Y, flags, &c->reply->hit)); check_hit(c); return;
    case 1:
        ASK(c, sizeof(collide_pair), collide_field_distance(c->space, F, S, X, Y, limit, flags, ROW));
        if (IS_OK(c)) check_pairs(c, 1);
        return;
    case 2:
        ASK(c, both, collide_field_collide_batch(c->space, F, S, Xs, Ys, flags, c->out, &c->reply->failed));
        check_hits(c, both);
        break;
    case 3:
        ASK(c, both * sizeof(collide_pair), collide_field_distance_batch(c->space, F, S, Xs, Ys, limit, flags, ROW,
                                                                         c->reply->statuses, &c->reply->failed));
        if (IS_OK(c)) check_pairs(c, both);
        break;
    case 4:
        ASK(c, capacity * sizeof(collide_contact), collide_field_contacts(c->space, F, S, X, Y, margin, most, flags & 1, CONTACTS,
                                                                          capacity, &c->reply->count));
        check_contacts(c, rows_written(c, capacity));
        return;
    case 5:
        ASK(c, 6 * 9 * sizeof(int64_t),
            (c->space != NULL ? collide_point_cloud_nearest(F, places, n, k, limit, c->reply->doubles, c->out)
                              : COLLIDE_INVALID_ARGUMENT));
        if (IS_OK(c)) {
            same_bytes(c, n * k * sizeof(int64_t));
            for (i = 0; i < n * k; i++) EXPECT(i % k == 0 || c->replies[0].doubles[i - 1] <= c->replies[0].doubles[i], "not nearest first");
        }
        return;
    default:
        ASK(c, capacity * sizeof(int64_t),
            (c->space != NULL ? collide_point_cloud_within(F, places, limit, c->out, capacity, &c->reply->count)
                              : COLLIDE_INVALID_ARGUMENT));
        same_bytes(c, rows_written(c, capacity) * sizeof(int64_t));
        return;
    }
    check_failed(c, both);
}

static void ask_world(struct caller *c)
{
    const collide_world *w = one_in(&c->s, 3) ? c->world : c->shared->worlds[below(&c->s, WORLDS)];
    double X[16], limit = limit_of(c), margin = margin_of(c), o[18], d[18];
    size_t capacity = capacity_of(c), n = 1 + below(&c->s, 6), most = 1 + below(&c->s, 6), k;
    const collide_shape *S = A_SHAPE(c);
    uint32_t group = (uint32_t)next(&c->s), mask = (uint32_t)next(&c->s);
    unsigned flags = one_in(&c->s, 40) ? (unsigned)next(&c->s) : one_in(&c->s, 2) ? COLLIDE_START_NORMALS : COLLIDE_TRUST_POSES;
    int filters = one_in(&c->s, 2);
    collide_poses start = {X, 1};
    collide_vectors along = {d, n};
    a_pose(c, X);
    for (k = 0; k < 18; k++) o[k] = coordinate(&c->s, 3.0), d[k] = coordinate(&c->s, 1.0);
    w = handle(c, w);
    c->is_bad = 0;
    switch (below(&c->s, 10)) {
    case 0:
        if (one_in(&c->s, 2)) ASK(c, 0, collide_world_collides(w, c->space, &c->reply->hit));
        else ASK(c, 0, collide_world_within(w, c->space, margin, &c->reply->hit));
        check_hit(c);
        return;
    case 1:
        ASK(c, capacity * 8, collide_world_hits(w, c->space, c->out, capacity, &c->reply->count));
        same_bytes(c, 8 * rows_written(c, capacity));
        return;
    case 2: ASK(c, capacity * sizeof(collide_pair), collide_world_collisions(w, c->space, ROW, capacity, &c->reply->count)); break;
    case 3: ASK(c, capacity * sizeof(collide_pair), collide_world_distances(w, c->space, limit, ROW, capacity, &c->reply->count)); break;
    case 4: ASK(c, sizeof(collide_pair), collide_world_minimum(w, c->space, limit, ROW, &c->reply->count)); capacity = 1; break;
    case 5:
        ASK(c, capacity * sizeof(collide_contact),
            collide_world_contacts(w, c->space, margin, most, CONTACTS, capacity, &c->reply->count));
        check_contacts(c, rows_written(c, capacity));
        return;
    case 6: ASK(c, capacity * sizeof(collide_pair), collide_world_query(w, c->space, S, X, limit, ROW, capacity, &c->reply->count)); break;
    case 7:
        ASK(c, capacity * 4, collide_world_boxes_near(w, c->space, o, d, margin, c->out, capacity, &c->reply->count));
        same_bytes(c, 4 * rows_written(c, capacity));
        return;
    default:
        if (one_in(&c->s, 2))
            ASK(c, n * sizeof(collide_world_hit),
                collide_world_raycast(w, c->space, o, d, n, limit, filters ? &group : NULL, filters ? &mask : NULL,
                                      c->out, c->reply->statuses));
        else if (one_in(&c->s, 2))
            ASK(c, n * sizeof(collide_world_hit),
                collide_world_nearest(w, c->space, o, n, limit, filters ? &group : NULL, filters ? &mask : NULL,
                                      c->out));
        else
            ASK(c, n * sizeof(collide_world_hit),
                collide_world_cast(w, c->space, S, start, along, limit, flags, filters ? &group : NULL,
                                   filters ? &mask : NULL, c->out, c->reply->statuses));
        for (k = 0; IS_OK(c) && k < n; k++) {
            const collide_world_hit *a = (const collide_world_hit *)(const void *)c->replies[0].rows + k;
            const collide_world_hit *b = (const collide_world_hit *)(const void *)c->replies[1].rows + k;
            EXPECT(memcmp(a, b, offsetof(collide_world_hit, at_start) + 1) == 0, "an equal question has another row");
            EXPECT(a->lower <= a->distance && a->distance <= a->upper, "a distance outside its bracket");
            EXPECT(a->hit == (a->body >= 0), "a hit without a body, or a body without a hit");
        }
        return;
    }
    {
        size_t rows = rows_written(c, capacity);
        const collide_pair *row = (const collide_pair *)(const void *)c->replies[0].rows;
        same_bytes(c, rows * sizeof *row);
        for (k = 0; k < rows; k++) {
            EXPECT(row[k].lower <= row[k].distance && row[k].distance <= row[k].upper, "a distance outside its bracket");
            EXPECT(k == 0 || row[k - 1].a < row[k].a || (row[k - 1].a == row[k].a && row[k - 1].b < row[k].b), "rows out of order");
        }
    }
}

/* --- changes ---------------------------------------------------------------------------------------------------------- */

static int32_t an_id(struct caller *c)
{
    return c->n_ids == 0 || one_in(&c->s, 60) ? (int32_t)below(&c->s, 1000) - 1 : c->ids[below(&c->s, c->n_ids)];
}

static void change_world(struct caller *c)
{
    double X[16 * 8];
    collide_body bodies[8];
    int32_t ids[16];
    size_t n = below(&c->s, 9), k, size = collide_world_size(c->world);
    collide_status status;
    int ignored;
    c->function = "a change of a world";
    for (k = 0; k < 16; k++) ids[k] = an_id(c);
    switch (below(&c->s, 8)) {
    case 0: case 1:
        for (k = 0; k < n; k++) bodies[k] = a_body(&c->s, c->shared, X + 16 * k);
        if (c->n_ids + n > 80) return;
        status = collide_world_add(c->world, bodies, n, ids);
        if (status == COLLIDE_OK) for (k = 0; k < n; k++) c->ids[c->n_ids++] = ids[k];
        EXPECT(collide_world_size(c->world) == size + (status == COLLIDE_OK ? n : 0), "a world of the wrong size after bodies were added");
        break;
    case 2:
        if (c->n_ids > 0 && !one_in(&c->s, 30)) {
            k = below(&c->s, c->n_ids), ids[0] = c->ids[k];
            c->ids[k] = c->ids[--c->n_ids];
            status = collide_world_remove(c->world, ids[0]);
            EXPECT(status == COLLIDE_OK && collide_world_size(c->world) == size - 1, "a body is not removed");
        }
        status = collide_world_remove(c->world, ids[0]);
        if (status == COLLIDE_OK) for (k = 0; k < c->n_ids; k++) if (c->ids[k] == ids[0]) c->ids[k--] = c->ids[--c->n_ids];
        break;
    case 3:
        for (k = 0; k < n; k++) pose(&c->s, X + 16 * k, &ignored);
        status = collide_world_move(c->world, ids, n, X);
        if (status == COLLIDE_OK && n > 0) {
            double Y[16];
            EXPECT(collide_world_pose(c->world, ids[n - 1], Y) == COLLIDE_OK && memcmp(Y, X + 16 * (n - 1), sizeof Y) == 0,
                   "a pose is not the one handed in");
        }
        break;
    case 4: status = collide_world_replace(c->world, ids[0], A_SHAPE(c)); break;
    case 5:
        if (one_in(&c->s, 2)) status = collide_world_replace_mesh(c->world, ids[0], A_MESH(c));
        else status = collide_world_replace_field(c->world, ids[0], A_FIELD(c));
        break;
    case 6:
        for (k = 0; k < 8; k++) X[k] = margin_of(c);
        if (one_in(&c->s, 3)) status = collide_world_set_margins(c->world, ids, n, X);
        else if (one_in(&c->s, 2)) status = collide_world_set_pair_margins(c->world, ids, n, one_in(&c->s, 3) ? NULL : X);
        else status = collide_world_sleep(c->world, ids, n, one_in(&c->s, 2));
        break;
    default: status = collide_world_allow(c->world, ids, n);
    }
    count_status(c, status);
    EXPECT(collide_world_message(c->world) != NULL && (status == COLLIDE_OK || *collide_world_message(c->world) != 0),
           "a refused change without a message");
    EXPECT(collide_world_size(c->world) == c->n_ids, "a world has another size than its bodies are many");
}

/* Shapes, sets and meshes of this thread alone, freed in one of the orders allowed. */
static void make_and_free(struct caller *c)
{
    collide_shape *shapes[4] = {NULL, NULL, NULL, NULL};
    collide_shape_set *set = NULL;
    collide_mesh *mesh = NULL;
    collide_field *field = NULL;
    collide_robot *robot = NULL;
    size_t k, first = below(&c->s, 4);
    const char *level;
    double X[16], Y[16];
    c->function = "things made";
    for (k = 0; k < 4; k++) count_status(c, make_shape(&c->s, &shapes[k]));
    count_status(c, collide_shape_set_create((const collide_shape *const *)shapes, 4, &set));
    EXPECT((set == NULL) == (!shapes[0] || !shapes[1] || !shapes[2] || !shapes[3]), "a set of shapes that were not made");
    if (shapes[0] != NULL) count_status(c, make_mesh(&c->s, shapes[0], &mesh));
    count_status(c, make_field(&c->s, &field));
    if (n_files > 0 && one_in(&c->s, 4)) {
        c->function = "collide_robot_read";
        count_status(c, make_robot(&c->s, &robot));
        collide_robot_free(robot);
        count_status(c, collide_robot_load(one_in(&c->s, 4) ? "no such file" : files[below(&c->s, n_files)].path, &robot));
    }
    EXPECT(collide_level(&level) == COLLIDE_OK && strcmp(collide_version(), COLLIDE_VERSION) == 0, "no level, or another version");
    a_pose(c, X), a_pose(c, Y);
    c->is_bad = 0;
    ASK(c, sizeof(collide_pair), collide_distance(c->space, shapes[0], shapes[1], X, Y, (double)INFINITY, 0, ROW));
    if (IS_OK(c)) check_pairs(c, 1);
    ASK(c, 0, collide_mesh_shape_collide(c->space, mesh, shapes[2], X, Y, 0, &c->reply->hit));
    check_hit(c);
    ASK(c, 0, collide_field_collide(c->space, field, shapes[3], X, Y, 0, &c->reply->hit));
    check_hit(c);
    if (one_in(&c->s, 2)) collide_mesh_free(mesh), mesh = NULL;
    collide_shape_set_free(set);
    for (k = 0; k < 4; k++) collide_shape_free(shapes[(k + first) % 4]);
    collide_field_free(field);
    collide_mesh_free(mesh);
    collide_robot_free(robot);
}

#define ROBOT_SPACE (c->space == NULL ? NULL : c->robot_spaces[c->reply - c->replies][number])

/* An object attached, another taken away, or a pair allowed, for both workspaces. */
static void change_objects(struct caller *c, size_t number)
{
    const collide_robot *robot = c->shared->robots[number];
    int32_t bodies = (int32_t)collide_robot_bodies(robot), names[4];
    const collide_compound *object = A_COMPOUND(c);
    double X[16], padding = one_in(&c->s, 4) ? length(&c->s) : 0.0;
    int32_t number_of_object = (int32_t)below(&c->s, 4);
    size_t k, n = below(&c->s, 3), last;
    a_pose(c, X);
    c->is_bad = 0;
    for (k = 0; k < 4; k++) {
        last = collide_robot_around(robot) + (size_t)bodies + 2;
        names[k] = (int32_t)below(&c->s, last) - (int32_t)collide_robot_around(robot);
    }
    if (one_in(&c->s, 2)) {
        ASK(c, 0, collide_robot_attach(ROBOT_SPACE, names[0], object, X, padding, names + 1, n, &c->reply->hit));
        EXPECT(c->replies[0].hit == c->replies[1].hit && c->replies[0].hit >= (IS_OK(c) ? bodies : -1), "an object without a number");
    } else if (one_in(&c->s, 3)) ASK(c, 0, collide_robot_allow(ROBOT_SPACE, names, n));
    else ASK(c, 0, collide_robot_detach(ROBOT_SPACE, bodies + number_of_object));
}

static void ask_robot(struct caller *c)
{
    size_t number = below(&c->s, ROBOTS), n = 1 + below(&c->s, 12), capacity = capacity_of(c), k, columns;
    const collide_robot *robot = c->shared->robots[number];
    double *q, *gradients, limit, resolution = one_in(&c->s, 60) ? odd(&c->s) : between(&c->s, 0.05, 0.5);
    unsigned between_which = one_in(&c->s, 40) ? (unsigned)next(&c->s) : 1 + (unsigned)below(&c->s, 3);
    if (robot == NULL) return;
    columns = collide_robot_columns(robot);
    if (collide_robot_around(robot) > 0) EXPECT(collide_robot_body_name(robot, -1) != NULL, "a body around without name");
    EXPECT(collide_robot_column_name(robot, columns) == NULL, "a column without number");
    for (k = 0; k < columns; k++) EXPECT(collide_robot_column_name(robot, k) != NULL, "a column without name");
    for (k = 0; k < collide_robot_bodies(robot); k++) EXPECT(collide_robot_body_name(robot, (int32_t)k) != NULL, "a body without name");
    if (n * columns > 20000) return;
    q = malloc((2 * n * columns + 1) * sizeof *q);
    gradients = malloc(ROWS * (columns + 1) * sizeof *gradients);
    for (k = 0; k < 2 * n * columns; k++) q[k] = one_in(&c->s, 5000) ? odd(&c->s) : between(&c->s, -1.5, 1.5);
    /* Motions take as long as their length is to the resolution: what is finite stays of a usual size. */
    if (resolution > 0.0 && resolution < 0.05) resolution = 0.05;
    for (k = 0; k < 2 * n * columns; k++) if (isfinite(q[k]) && fabs(q[k]) > 10.0) q[k] = 10.0;
    if (one_in(&c->s, 2)) for (k = n * columns; k < 2 * n * columns; k++) q[k] = q[k - n * columns] + between(&c->s, -0.1, 0.1);
    if (one_in(&c->s, 4)) change_objects(c, number);
    if (one_in(&c->s, 4)) { /* one body around moves, for both workspaces */
        double X[16], Y[16];
        int32_t body = -1 - (int32_t)below(&c->s, collide_robot_around(robot) + 1);
        pose(&c->s, X, &c->is_bad);
        c->is_bad = 0;
        ASK(c, 0, collide_robot_move_around(ROBOT_SPACE, &body, 1, X, &c->reply->failed));
        if (IS_OK(c)) EXPECT(collide_robot_pose_around(c->robot_spaces[0][number], body, Y) == COLLIDE_OK &&
                             memcmp(X, Y, sizeof Y) == 0, "a body around is not where it was moved");
    }
    switch (below(&c->s, 5)) {
    case 0:
        ASK(c, n, collide_robot_collide(ROBOT_SPACE, q, n, c->out, c->reply->statuses, &c->reply->failed));
        check_hits(c, n);
        break;
    case 1:
        limit = limit_of(c);
        ASK(c, n * sizeof(collide_pair), collide_robot_distance(ROBOT_SPACE, q, n, limit, between_which, ROW,
                                                                one_in(&c->s, 2) ? gradients : NULL, c->reply->statuses,
                                                                &c->reply->failed));
        if (IS_OK(c)) same_bytes(c, n * sizeof(collide_pair));
        break;
    case 2:
        limit = limit_of(c);
        ASK(c, capacity * sizeof(collide_pair), collide_robot_near(ROBOT_SPACE, q, n, limit, between_which, ROW, NULL, capacity,
                                                                   c->reply->starts, c->reply->statuses, &c->reply->failed));
        if (IS_OK(c)) {
            EXPECT(c->replies[0].starts[n] <= capacity, "more rows than there is room for");
            same_bytes(c, c->replies[0].starts[n] * sizeof(collide_pair));
        }
        break;
    case 3:
        n = n > 3 ? 3 : n;
        ASK(c, n, collide_robot_certify(ROBOT_SPACE, q, q + n * columns, n, resolution, c->out, c->reply->doubles,
                                        c->reply->statuses, &c->reply->failed));
        if (IS_OK(c)) same_bytes(c, n);
        break;
    default:
        n = n > 3 ? 3 : n;
        ASK(c, n, collide_robot_sample(ROBOT_SPACE, q, q + n * columns, n, resolution, c->out, c->reply->doubles,
                                       c->reply->statuses, &c->reply->failed));
        if (IS_OK(c)) same_bytes(c, n);
    }
    check_failed(c, n);
    free(q);
    free(gradients);
}

/* --- threads ---------------------------------------------------------------------------------------------------------- */

static void (*const kinds[])(struct caller *) = {
    ask_pair, ask_pair, ask_unsigned, ask_batch, ask_each, ask_within, ask_contacts, ask_cast, ask_impact, ask_compounds, ask_meshes,
    ask_meshes, ask_rays, ask_fields, ask_world, ask_world, change_world, change_world, change_world, make_and_free, ask_robot
};

static void begin_spaces(struct caller *c, int side)
{
    size_t k;
    if (collide_workspace_create(&c->spaces[side]) != COLLIDE_OK) abort();
    for (k = 0; k < ROBOTS; k++)
        if (c->shared->robots[k] != NULL && c->robot_spaces[side][k] == NULL &&
            collide_robot_workspace_create(c->shared->robots[k], &c->robot_spaces[side][k]) != COLLIDE_OK)
            violation(c, "no workspace of a robot");
}
static void *calls_of_a_round(void *of)
{
    struct caller *c = of;
    int side;
    size_t k;
    uint64_t last = repeats ? only_call + 1 : CALLS_A_ROUND;
    c->function = "a workspace made";
    for (side = 0; side < 2; side++) begin_spaces(c, side);
    if (collide_world_create(&c->world) != COLLIDE_OK) abort();
    c->n_ids = 0;
    for (c->call = 0; c->call < last; c->call++) {
        c->s = stream_of(seed, c->round, c->thread, c->call);
        c->is_bad = 0;
        if (one_in(&c->s, 30)) {
            collide_workspace_free(c->spaces[1]);
            begin_spaces(c, 1);
        }
        kinds[below(&c->s, sizeof kinds / sizeof *kinds)](c);
        EXPECT(*collide_status_text(c->replies[0].status) != 0, "a status without a text");
        EXPECT(collide_workspace_message(c->spaces[0]) != NULL, "a message that is NULL");
    }
    c->function = "things freed";
    collide_world_free(c->world);
    for (side = 0; side < 2; side++) {
        collide_workspace_free(c->spaces[side]);
        for (k = 0; k < ROBOTS; k++) collide_robot_workspace_free(c->robot_spaces[side][k]), c->robot_spaces[side][k] = NULL;
    }
    return NULL;
}

static void read_file(const char *path)
{
    FILE *file = fopen(path, "rb");
    size_t n;
    if (file == NULL || n_files == sizeof files / sizeof *files) {
        fprintf(stderr, "%s: no such file, or too many of them\n", path);
        exit(2);
    }
    fseek(file, 0, SEEK_END);
    n = (size_t)ftell(file);
    rewind(file);
    files[n_files].path = path;
    files[n_files].bytes = malloc(n);
    files[n_files].n = fread(files[n_files].bytes, 1, n, file);
    fclose(file);
    n_files++;
}

int main(int n_arguments, char **arguments)
{
    uint64_t n_calls = 100000, round, calls = 0, told_so_far = 0, compared = 0, told[STATUSES] = {0};
    unsigned long n_threads = 4, t;
    int k;
    struct shared shared;
    pthread_t threads[MOST_THREADS];
    for (k = 1; k + 1 < n_arguments; k += 2) {
        const char *value = arguments[k + 1];
        unsigned long long a, b, d;
        if (strcmp(arguments[k], "--calls") == 0) n_calls = strtoull(value, NULL, 10);
        else if (strcmp(arguments[k], "--seed") == 0) seed = strtoull(value, NULL, 10);
        else if (strcmp(arguments[k], "--threads") == 0) n_threads = strtoul(value, NULL, 10);
        else if (strcmp(arguments[k], "--robots") == 0) read_file(value);
        else if (strcmp(arguments[k], "--repeat") == 0 && sscanf(value, "%llu.%llu.%llu", &a, &b, &d) == 3)
            repeats = 1, only_round = a, only_thread = b, only_call = d;
        else k = n_arguments;
    }
    if (k != n_arguments || n_threads < 1 || n_threads > MOST_THREADS) {
        fprintf(stderr, "soak_c_interface --calls N --seed S --threads T [--robots FILE]... [--repeat ROUND.THREAD.CALL]\n");
        return 2;
    }
    signal(SIGTERM, say_signal);
    signal(SIGABRT, say_signal); /* sanitizers end by it */
#if !defined(__SANITIZE_ADDRESS__)
    signal(SIGSEGV, say_signal);
    signal(SIGFPE, say_signal);
#endif
    if (repeats) n_threads = 1;
    for (t = 0; t < n_threads; t++) {
        callers[t] = calloc(1, sizeof *callers[t]);
        callers[t]->seed = seed, callers[t]->thread = repeats ? only_thread : t, callers[t]->shared = &shared;
    }
    for (round = repeats ? only_round : 0; calls < n_calls; round++) {
        stream s = stream_of(seed, round, 2000, 0);
        for (t = 0; t < n_threads; t++) callers[t]->round = round, callers[t]->function = "things made for all";
        make_shared(&shared, round);
        for (t = 0; t < n_threads; t++) if (pthread_create(&threads[t], NULL, calls_of_a_round, callers[t]) != 0) abort();
        for (t = 0; t < n_threads; t++) pthread_join(threads[t], NULL);
        free_shared(&shared, &s);
        for (calls = t = 0; t < n_threads; t++) calls += callers[t]->calls;
        if (calls >= told_so_far + n_calls / 20) {
            printf("%12llu calls so far\n", (unsigned long long)(told_so_far = calls));
            fflush(stdout);
        }
        if (repeats) break;
    }
    for (t = 0; t < n_threads; t++) {
        compared += callers[t]->compared;
        for (k = 0; k < STATUSES; k++) told[k] += callers[t]->told[k];
        free(callers[t]);
        callers[t] = NULL;
    }
    printf("%llu calls, %llu questions asked twice, seed %llu\n", (unsigned long long)calls, (unsigned long long)compared,
           (unsigned long long)seed);
    for (k = 0; k < STATUSES; k++) printf("%12llu  %s\n", (unsigned long long)told[k], collide_status_text((collide_status)k));
    for (t = 0; t < n_files; t++) free(files[t].bytes);
    return 0;
}
