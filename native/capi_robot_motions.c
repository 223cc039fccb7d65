/* Straight motions of a robot, sampled and certified: collide/robots/certified_edges.py. */
#include "capi_robot.h"

#include <stdlib.h>
#include <string.h>

/* Open intervals that there is room for at first; how often motions are halved before anything is proven, and at most. */
enum { OPEN_INTERVALS = 4096, SAMPLED_HALVINGS = 2, MAX_HALVINGS = 30 };
/* Words of a cursor of samples. */
enum { MOTION, SAMPLE, N_OPEN_SAMPLES };
/* What is known of a motion while it is asked about, besides COLLIDE_MOTION_...: something is left to Python. */
enum { UNANSWERED = 3 };

#define ZEROED(word, count, bytes) header[word] = address_of(arena_zeroed(&space->arena, (size_t)(count), bytes))
#define SHARED(word, section) header[word] = address_of(robot->section)

/* Room for n open intervals, and for as many pairs of meshes. */
static int fit_intervals(collide_robot_workspace *space, int64_t n)
{
    double *grown = realloc(space->intervals, (size_t)(2 * OPEN_INTERVAL * n) * sizeof *grown);
    if (grown == NULL) return 0;
    space->intervals = grown;
    space->n_intervals = n;
    space->motions[OPEN_INTERVALS_AT] = address_of(grown);
    space->motions[MESH_PAIRS_AT] = address_of(grown + OPEN_INTERVAL * n);
    space->motions[OPEN_INTERVAL_CAPACITY] = space->motions[MESH_PAIR_CAPACITY] = n;
    return 1;
}

int begin_motions(collide_robot_workspace *space)
{
    const collide_robot *robot = space->robot;
    const int64_t *n = robot->sizes, columns = n[F_COLUMNS] + 1;
    int64_t *header = space->motions;
    SHARED(PATHS_AT, paths), SHARED(PATH_LENGTHS_AT, path_lengths), SHARED(BETWEEN_AT, between);
    header[PATH_STRIDE] = n[F_STRIDE], header[ITEM_CAPACITY] = n[F_ITEMS], header[OPEN_STRIDE] = OPEN_INTERVAL;
    ZEROED(CONFIGURATION_AT, columns, sizeof(double)), ZEROED(MOVED_AT, (n[F_BODIES] + MAX_OBJECTS) * (n[F_STRIDE] + 1), sizeof(double));
    ZEROED(INTERVALS_AT, INTERVAL * (MAX_INTERVALS + 1), sizeof(double)), ZEROED(ITEMS_AT, ITEM * (n[F_ITEMS] + 1), 8);
    ZEROED(CHANGES_AT, columns, sizeof(double)), ZEROED(POINTS_AT, MAX_DEGREE + 1, sizeof(double));
    ZEROED(BOXES_AT, (MAX_INTERVALS + 1) * 2 * columns, sizeof(double));
    memcpy(&header[ROUNDING], &robot->scalars[S_ROUNDING], sizeof(double));
    space->sampled = arena_zeroed(&space->arena, (size_t)(LANES * columns), sizeof(double));
    space->samples = arena_zeroed(&space->arena, (size_t)(OPEN_SAMPLE * space->scene[OPEN_CAPACITY]), sizeof(double));
    return !space->arena.failed && fit_intervals(space, OPEN_INTERVALS);
}

void end_motions(collide_robot_workspace *space) { free(space->intervals); }

static int are_motions(const collide_robot_workspace *space, const double *first, const double *last, size_t n, double resolution,
                       const uint8_t *verdicts)
{
    return are_configurations(space, first, n) && are_configurations(space, last, n) && resolution > 0.0 &&
           resolution < INFINITE && (verdicts != NULL || n == 0);
}

/* Times of collisions at samples of n motions, NaN of others; a motion becomes UNANSWERED where a sample is left to Python. */
static void sample(collide_robot_workspace *space, const double *first, const double *last, size_t n, double step, int halvings,
                   double *times, uint8_t *verdicts)
{
    int64_t cursor[CURSOR] = {0, 0, 0}, before[2], k;
    for (k = 0; k < (int64_t)n; k++) times[k] = NAN;
    memset(verdicts, 0, n);
    while (cursor[MOTION] < (int64_t)n) {
        memcpy(before, cursor, sizeof before);
        space->robot->kernels->sample_motions(address_of(space->scene), address_of(first), address_of(last),
                                              space->robot->sizes[F_COLUMNS], (int64_t)n, step, halvings,
                                              address_of(space->sampled), address_of(cursor), address_of(space->samples),
                                              address_of(times));
        for (k = 0; k < cursor[N_OPEN_SAMPLES]; k++) verdicts[(int64_t)space->samples[OPEN_SAMPLE * k]] = UNANSWERED;
        if (memcmp(before, cursor, sizeof before) == 0) { /* a sample that leaves more to others than there is room for */
            verdicts[cursor[MOTION]++] = UNANSWERED;
            cursor[SAMPLE] = 0;
        }
    }
    for (k = 0; k < (int64_t)n; k++)
        if (times[k] == times[k]) verdicts[k] = COLLIDE_MOTION_COLLIDES;
}

/* Marks motions of what the kernel has left: intervals that stay open, pairs of meshes. */
static void mark_open(const collide_robot_workspace *space, uint8_t *verdicts)
{
    const double *meshes = space->intervals + OPEN_INTERVAL * space->n_intervals;
    int64_t k;
    for (k = 0; k < space->motions[N_OPEN_INTERVALS]; k++)
        verdicts[(int64_t)space->intervals[OPEN_INTERVAL * k]] = COLLIDE_MOTION_OPEN;
    for (k = 0; k < space->motions[N_MESH_PAIRS]; k++) verdicts[(int64_t)meshes[OPEN_INTERVAL * k]] = UNANSWERED;
}

/* Prove n motions of which samples are known; those whose samples are left to Python are not asked. */
static collide_status certify(collide_robot_workspace *space, const double *first, const double *last, size_t n, double resolution,
                              double *times, uint8_t *verdicts)
{
    int64_t done = 0, next, k;
    for (k = 0; k < (int64_t)n; k++) {
        if (verdicts[k] == UNANSWERED) times[k] = 0.0;
        else if (verdicts[k] == COLLIDE_MOTION_OPEN) verdicts[k] = COLLIDE_MOTION_FREE;
    }
    space->motions[N_CHECKED] = 0;
    memcpy(&space->motions[RESOLUTION], &resolution, sizeof resolution);
    for (; done < (int64_t)n; done = next) {
        next = space->robot->kernels->certify_motions(address_of(space->scene), address_of(space->motions), address_of(first),
                                                      address_of(last), space->robot->sizes[F_COLUMNS], done, (int64_t)n,
                                                      address_of(times));
        mark_open(space, verdicts);
        if (next == done && !fit_intervals(space, 2 * space->n_intervals)) return COLLIDE_NO_MEMORY;
    }
    for (k = 0; k < (int64_t)n; k++) {
        if (verdicts[k] == UNANSWERED) times[k] = NAN;
        else if (times[k] == times[k]) verdicts[k] = COLLIDE_MOTION_COLLIDES;
    }
    return COLLIDE_OK;
}

/* Verdicts that are left to Python are said so; `beside` stands in their place. */
static collide_status report_unanswered(struct unanswered *rest, uint8_t *verdicts, uint8_t beside, size_t n)
{
    size_t k;
    for (k = 0; k < n; k++) {
        if (verdicts[k] != UNANSWERED) continue;
        verdicts[k] = beside;
        note_unanswered(rest, k);
    }
    return end_unanswered(rest, n);
}

collide_status collide_robot_certify(collide_robot_workspace *workspace, const double *first, const double *last, size_t n,
                                     double resolution, uint8_t *verdicts, double *times, collide_status *statuses, size_t *failed)
{
    struct unanswered rest = begin_unanswered(statuses, failed, n);
    double *known = times;
    collide_status status;
    rounding given;
    if (!are_motions(workspace, first, last, n, resolution, verdicts)) return COLLIDE_INVALID_ARGUMENT;
    if (known == NULL && (known = malloc((n + 1) * sizeof *known)) == NULL) return COLLIDE_NO_MEMORY;
    given = round_as_kernels_do();
    sample(workspace, first, last, n, resolution, SAMPLED_HALVINGS, known, verdicts);
    status = certify(workspace, first, last, n, resolution, known, verdicts);
    round_as_before(given);
    if (times == NULL) free(known);
    return status == COLLIDE_OK ? report_unanswered(&rest, verdicts, COLLIDE_MOTION_OPEN, n) : status;
}

collide_status collide_robot_sample(collide_robot_workspace *workspace, const double *first, const double *last, size_t n,
                                    double resolution, uint8_t *hits, double *times, collide_status *statuses, size_t *failed)
{
    struct unanswered rest = begin_unanswered(statuses, failed, n);
    double *known = times, most = resolution * (double)((int64_t)1 << MAX_HALVINGS);
    collide_status status;
    rounding given;
    size_t k, values;
    if (!are_motions(workspace, first, last, n, resolution, hits)) return COLLIDE_INVALID_ARGUMENT;
    values = n * (size_t)workspace->robot->sizes[F_COLUMNS];
    for (k = 0; k < values; k++) if (!(fabs(last[k] - first[k]) <= most)) return COLLIDE_INVALID_ARGUMENT;
    if (known == NULL && (known = malloc((n + 1) * sizeof *known)) == NULL) return COLLIDE_NO_MEMORY;
    given = round_as_kernels_do();
    sample(workspace, first, last, n, resolution, MAX_HALVINGS, known, hits);
    round_as_before(given);
    if (times == NULL) free(known);
    status = report_unanswered(&rest, hits, 0, n);
    for (k = 0; k < n; k++) hits[k] = hits[k] == COLLIDE_MOTION_COLLIDES;
    return status;
}
