/* Robots from the files of collide/robots/checker_file.py: sections, shapes, names. */
#include "capi_robot.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Words of a file: what it is, its version, how many there are, a digest of those behind; then two of each section. */
enum { MAGIC, VERSION, WORDS, FILE_DIGEST, MESSAGE = FILE_DIGEST + 2, BEGIN_OF_SECTIONS = MESSAGE + 2 * N_SECTIONS };
/* The most of anything, and of words: no product of sizes overflows. */
static const int64_t LARGEST_SIZE = (int64_t)1 << 24, MAX_WORDS = (int64_t)1 << 34;

/* Whether the kernels' layouts are those that this file was written for. */
static int robot_layouts_fit(const struct collide_kernels *kernels)
{
    static const int64_t known[] = {
        SCENE_HEADER, MOTION_HEADER, SPHERE_HEADER, SEARCH, JOINT_INTS, JOINT_DOUBLES, BODY_INTS, BOX, PART, NODE_LINK,
        BODY_SPHERES, SPHERE, PART_NUMBERS, MAP_INTS, MAP_DOUBLES, LINK_POSE, LANES, OPEN_INTS, OPEN_PAIR, SPHERE_PLACE,
        INTERVAL, MAX_INTERVALS, MAX_PIECES, ITEM, OPEN_INTERVAL, MAX_DEGREE, CURSOR, OPEN_SAMPLE
    };
    int64_t measured[sizeof known / sizeof *known], n = sizeof known / sizeof *known;
    return kernels->write_robot_constants(address_of(measured), n) == n && memcmp(measured, known, sizeof known) == 0;
}

/* Whether the words are a whole file of this version, undamaged. */
static int is_file(const struct collide_kernels *kernels, const int64_t *file, int64_t n_words)
{
    int64_t digest[2], memory[DIGEST_WORDS];
    if (memcmp(file, "COLLIDER", 8) != 0 || file[VERSION] != 2 || file[WORDS] != n_words) return 0;
    kernels->digest_numbers(address_of(file + MESSAGE), n_words - MESSAGE, 0, 0, 0, 0, address_of(memory), address_of(digest));
    return memcmp(file + FILE_DIGEST, digest, sizeof digest) == 0;
}

/* Where a section of elements begins; NULL where it reaches out of the file. Its count becomes known. */
static const void *section(collide_robot *robot, int number, int64_t bytes, int64_t n_words)
{
    int64_t first = robot->file[MESSAGE + 2 * number], count = robot->file[MESSAGE + 2 * number + 1];
    if (first < BEGIN_OF_SECTIONS || first > n_words || count < 0 || count > 8 * n_words) return NULL;
    if ((count * bytes + 7) / 8 > n_words - first) return NULL;
    robot->counts[number] = count;
    return robot->file + first;
}

/* Views of the sections; 0 where one is not as long as sizes say. */
static int view_sections(collide_robot *robot, int64_t n_words)
{
    const int64_t *n;
    int k;
#define X(name, type, count)                                                                              \
    if ((robot->name = section(robot, SECTION_##name, (int64_t)sizeof(type), n_words)) == NULL) return 0;
    ROBOT_SECTIONS
#undef X
    n = robot->sizes;
    if (robot->counts[SECTION_sizes] != F_SIZES) return 0;
    for (k = 0; k < F_SIZES; k++) if (n[k] < 0 || n[k] > LARGEST_SIZE) return 0;
    if (n[F_HAS_SPHERES] > 1 || n[F_HAS_MESHES] > 1 || n[F_HAS_MARGINS] > 1 || (n[F_FACET_BODIES] > 0 && n[F_HAS_MESHES] == 0) ||
        n[F_ROOT] >= n[F_LINKS] || n[F_LINK_PARTS] > n[F_PARTS] || n[F_TWINS_AFTER] > n[F_LINK_PARTS])
        return 0;
#define X(name, type, count)                                                                        \
    if ((count) >= 0 && robot->counts[SECTION_##name] != (int64_t)(count)) return 0;
    ROBOT_SECTIONS
#undef X
    return 1;
}

/* Texts one behind another, each ended by a zero: as many as there are columns, bodies and bodies around. */
static collide_status read_texts(collide_robot *robot)
{
    int64_t n = robot->sizes[F_COLUMNS] + robot->sizes[F_BODIES] + robot->sizes[F_AROUND], k, count = 0;
    const char *texts = (const char *)robot->names;
    robot->texts = arena_zeroed(&robot->arena, (size_t)n + 1, sizeof *robot->texts);
    if (robot->texts == NULL) return COLLIDE_NO_MEMORY;
    for (k = 0; k < robot->counts[SECTION_names]; k++) {
        if (k == 0 || texts[k - 1] == 0) {
            if (count == n) return COLLIDE_INVALID_FILE;
            robot->texts[count++] = texts + k;
        }
    }
    return count == n && (k == 0 || texts[k - 1] == 0) ? COLLIDE_OK : COLLIDE_INVALID_FILE;
}

/* Rows of shapes, made anew from kinds, numbers and points; their order among each other is the file's. */
static collide_status read_shapes(collide_robot *robot)
{
    int64_t n = robot->sizes[F_SHAPES], remaining = robot->counts[SECTION_points] / 3, k;
    const double *points = robot->points;
    robot->shapes = arena_zeroed(&robot->arena, (size_t)n + 1, sizeof *robot->shapes);
    robot->shape_rows = arena_zeroed(&robot->arena, (size_t)n + 1, INTS * sizeof *robot->shape_rows);
    if (robot->shapes == NULL || robot->shape_rows == NULL) return COLLIDE_NO_MEMORY;
    for (k = 0; k < n; k++) {
        const int64_t *row = robot->shape_ints + 4 * k, *made;
        collide_status status;
        if (row[1] < 0 || row[1] > remaining) return COLLIDE_INVALID_FILE;
        status = shape_of_row(row[0], robot->shape_numbers + NUMBERS * k, points, (size_t)row[1], row[2] != 0, &robot->shapes[k]);
        if (status != COLLIDE_OK) return status == COLLIDE_INVALID_SHAPE ? COLLIDE_INVALID_FILE : status;
        made = robot->shapes[k]->ints;
        memcpy(robot->shape_rows + INTS * k, made, INTS * sizeof *made);
        robot->shape_rows[INTS * k + RANK] = row[3];
        if (memcmp(&robot->shapes[k]->numbers[REACH], robot->shape_numbers + NUMBERS * k + REACH, sizeof(double)) != 0)
            return COLLIDE_INVALID_FILE;
        points += 3 * row[1];
        remaining -= row[1];
    }
    return remaining == 0 ? COLLIDE_OK : COLLIDE_INVALID_FILE;
}

static collide_status read_robot(collide_robot *robot, const void *bytes, size_t n)
{
    int64_t n_words = (int64_t)(n / 8);
    collide_status status;
    if (n % 8 != 0 || n_words < BEGIN_OF_SECTIONS || n_words > MAX_WORDS) return COLLIDE_INVALID_FILE;
    if ((robot->file = arena_take(&robot->arena, n)) == NULL) return COLLIDE_NO_MEMORY;
    memcpy(robot->file, bytes, n);
    if (!is_file(robot->kernels, robot->file, n_words) || !view_sections(robot, n_words)) return COLLIDE_INVALID_FILE;
    if ((status = read_texts(robot)) != COLLIDE_OK || (status = check_robot(robot)) != COLLIDE_OK) return status;
    if ((status = read_shapes(robot)) != COLLIDE_OK) return status;
    return robot->sizes[F_HAS_MESHES] ? read_meshes(robot) : COLLIDE_OK;
}

collide_status collide_robot_read(const void *bytes, size_t n, collide_robot **robot)
{
    collide_robot *made;
    collide_status status;
    rounding given;
    if (robot == NULL) return COLLIDE_INVALID_ARGUMENT;
    *robot = NULL;
    if (bytes == NULL) return COLLIDE_INVALID_ARGUMENT;
    if ((made = calloc(1, sizeof *made)) == NULL) return COLLIDE_NO_MEMORY;
    made->word = ROBOT_WORD;
    arena_begin(&made->arena);
    made->kernels = kernels_here();
    given = round_as_kernels_do();
    status = made->kernels == NULL || !robot_layouts_fit(made->kernels) ? COLLIDE_NO_KERNELS : read_robot(made, bytes, n);
    round_as_before(given);
    if (status == COLLIDE_OK) *robot = made;
    else collide_robot_free(made);
    return status;
}

collide_status collide_robot_load(const char *path, collide_robot **robot)
{
    enum { PIECE = 1 << 16 };
    collide_status status = COLLIDE_OK;
    unsigned char *bytes = NULL;
    size_t n = 0, capacity = 0;
    FILE *file;
    if (robot == NULL) return COLLIDE_INVALID_ARGUMENT;
    *robot = NULL;
    if (path == NULL) return COLLIDE_INVALID_ARGUMENT;
    if ((file = fopen(path, "rb")) == NULL) return COLLIDE_INVALID_FILE;
    while (status == COLLIDE_OK && !feof(file) && !ferror(file)) {
        if (capacity - n < PIECE) {
            unsigned char *grown = realloc(bytes, capacity = 2 * capacity + PIECE);
            if (grown == NULL) status = COLLIDE_NO_MEMORY;
            else bytes = grown;
        }
        if (status == COLLIDE_OK) n += fread(bytes + n, 1, PIECE, file);
    }
    if (status == COLLIDE_OK) status = ferror(file) ? COLLIDE_INVALID_FILE : collide_robot_read(bytes, n, robot);
    fclose(file);
    free(bytes);
    return status;
}

void collide_robot_free(collide_robot *robot)
{
    int64_t k;
    if (!IS_HANDLE(robot, ROBOT_WORD)) return;
    end_handle(&robot->word);
    for (k = 0; robot->shapes != NULL && k < robot->sizes[F_SHAPES]; k++) collide_shape_free(robot->shapes[k]);
    free_meshes(robot);
    arena_end(&robot->arena);
    free(robot);
}

size_t collide_robot_columns(const collide_robot *robot) { return !IS_HANDLE(robot, ROBOT_WORD) ? 0 : (size_t)robot->sizes[F_COLUMNS]; }
size_t collide_robot_bodies(const collide_robot *robot) { return !IS_HANDLE(robot, ROBOT_WORD) ? 0 : (size_t)robot->sizes[F_BODIES]; }
size_t collide_robot_around(const collide_robot *robot) { return !IS_HANDLE(robot, ROBOT_WORD) ? 0 : (size_t)robot->sizes[F_AROUND]; }

const char *collide_robot_column_name(const collide_robot *robot, size_t column)
{
    return column < collide_robot_columns(robot) ? robot->texts[column] : NULL;
}

const char *collide_robot_body_name(const collide_robot *robot, int32_t body)
{
    int64_t number = body;
    if (!IS_HANDLE(robot, ROBOT_WORD) || number >= robot->sizes[F_BODIES] || -1 - number >= robot->sizes[F_AROUND]) return NULL;
    if (number < 0) number = robot->sizes[F_BODIES] - 1 - number;
    return robot->texts[robot->sizes[F_COLUMNS] + number];
}
