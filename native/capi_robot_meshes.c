/* Robots with meshes: bodies of facets from a file, and the questions of collide/robots/mesh_questions.py about them. */
#include "capi_mesh.h"
#include "capi_robot.h"

#include <stdlib.h>

/* Words of a body of facets in a file, and of a question there. */
enum { IS_MESH, N_VERTICES, N_FACES, IS_SOLID, FACET_BODY };
enum { Q_HOW, Q_BODY, Q_PARTNER, Q_ROW, QUESTION_OF_FILE };
/* How a pair is asked; words of a question as kernels read it, and what stands before all (collide/robots/mesh_states.py). */
enum { UNKNOWN, FACETS_OF_BOTH, FACETS_OF_BODY, FACETS_OF_PARTNER, HULLS };
enum { HOW, HEADER_AT, POSE_ROW, QUESTION };
enum { MEET_CODE, GAP_CODE, STRIDE, QUESTIONS };
/* Words of the stack of a walk down a tree: for each of 8 boxes on 136 levels, and beyond. */
enum { WALK_STACK = 8 * (136 + 2) };

static int is_index(int64_t value, int64_t n) { return value >= 0 && value < n; }

/* A mesh, or the facets of the hull of points. */
static collide_status read_body(const int64_t *body, double radius, const double *vertices, const int64_t *faces, collide_mesh **mesh)
{
    const double numbers[NUMBERS] = {radius, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    collide_shape *hull = NULL;
    collide_status status;
    int32_t *numbered;
    int64_t k, n = 3 * body[N_FACES];
    if (body[IS_MESH] == 0) {
        status = shape_of_row(POINTS, numbers, vertices, (size_t)body[N_VERTICES], 0, &hull);
        if (status == COLLIDE_OK) status = collide_mesh_of_shape(hull, mesh);
        collide_shape_free(hull);
        return status;
    }
    if ((numbered = malloc((size_t)(n + 1) * sizeof *numbered)) == NULL) return COLLIDE_NO_MEMORY;
    for (k = 0; k < n; k++) numbered[k] = is_index(faces[k], body[N_VERTICES]) ? (int32_t)faces[k] : -1;
    status = collide_mesh_create(vertices, (size_t)body[N_VERTICES], numbered, (size_t)body[N_FACES],
                                 body[IS_SOLID] ? COLLIDE_SOLID : COLLIDE_SURFACE, mesh);
    free(numbered);
    return status;
}

/* Whether every question names bodies of facets, and the pose of a part around where it is about one. */
static int are_questions(const collide_robot *robot)
{
    const int64_t *n = robot->sizes, stride = n[F_AROUND] + n[F_BODIES];
    int64_t k;
    for (k = 0; k < n[F_BODIES] * stride; k++) {
        const int64_t *asked = robot->questions + QUESTION_OF_FILE * k;
        int64_t how = asked[Q_HOW], row = asked[Q_ROW];
        if (!is_index(how, HULLS + 1)) return 0;
        if (how == UNKNOWN) continue;
        if (how != HULLS && !is_index(asked[Q_BODY], n[F_FACET_BODIES])) return 0;
        if (how == FACETS_OF_BOTH && !is_index(asked[Q_PARTNER], n[F_FACET_BODIES])) return 0;
        if (k % stride < n[F_AROUND] ? !is_index(row - n[F_LINK_PARTS], n[F_PARTS] - n[F_LINK_PARTS]) : row != -1) return 0;
    }
    for (k = 0; k <= 2 * n[F_FACET_BODIES]; k++)
        if (!is_coordinate(robot->facet_numbers[k]) || robot->facet_numbers[k] < 0.0) return 0;
    return 1;
}

collide_status read_meshes(collide_robot *robot)
{
    int64_t n = robot->sizes[F_FACET_BODIES], vertices = robot->counts[SECTION_facet_vertices] / 3, k;
    int64_t facets = robot->counts[SECTION_facet_faces] / 3, first = 0, first_face = 0;
    if (!are_questions(robot)) return COLLIDE_INVALID_FILE;
    robot->meshes = arena_zeroed(&robot->arena, (size_t)n + 1, sizeof *robot->meshes);
    if (robot->meshes == NULL) return COLLIDE_NO_MEMORY;
    for (k = 0; k < n; k++) {
        const int64_t *body = robot->facet_ints + FACET_BODY * k;
        collide_status status;
        if (!is_index(body[N_VERTICES], vertices - first + 1) || !is_index(body[N_FACES], facets - first_face + 1))
            return COLLIDE_INVALID_FILE;
        status = read_body(body, robot->facet_numbers[1 + 2 * k], robot->facet_vertices + 3 * first,
                           robot->facet_faces + 3 * first_face, &robot->meshes[k]);
        if (status == COLLIDE_NO_MEMORY) return status;
        if (status != COLLIDE_OK) return COLLIDE_INVALID_FILE;
        first += body[N_VERTICES];
        first_face += body[N_FACES];
    }
    return COLLIDE_OK;
}

void free_meshes(collide_robot *robot)
{
    int64_t k;
    for (k = 0; robot->meshes != NULL && k < robot->sizes[F_FACET_BODIES]; k++) collide_mesh_free(robot->meshes[k]);
}

/* Headers of walks along the facets of each body, one behind another, on one stack; NULL without memory. */
static int64_t *begin_walks(collide_robot_workspace *space, const int64_t *m)
{
    const collide_robot *robot = space->robot;
    int64_t n = robot->sizes[F_FACET_BODIES], k;
    int64_t *walks = arena_zeroed(&space->arena, (size_t)(n + 1), 8 * (size_t)m[M_WALK_HEADER]);
    int64_t *stack = arena_zeroed(&space->arena, 2 * WALK_STACK, 8);
    if (walks == NULL || stack == NULL) return NULL;
    for (k = 0; k < n; k++)
        write_facet_walk(space->pairs, robot->meshes[k]->tree, robot->facet_numbers[2 + 2 * k], robot->facet_numbers[0], stack,
                         WALK_STACK, walks + m[M_WALK_HEADER] * k);
    return walks;
}

/* The header that a question works on, 0 where it needs none; -1 without memory. */
static int64_t header_of(collide_robot_workspace *space, const int64_t *m, const int64_t *asked, const int64_t *walks)
{
    collide_mesh *const *meshes = space->robot->meshes;
    int64_t *header;
    if (asked[Q_HOW] == UNKNOWN || asked[Q_HOW] == HULLS) return 0;
    if (asked[Q_HOW] != FACETS_OF_BOTH) return address_of(walks + m[M_WALK_HEADER] * asked[Q_BODY]);
    if ((header = arena_zeroed(&space->arena, (size_t)m[M_MESH_HEADER], 8)) == NULL) return -1;
    write_mesh_header(space->pairs, meshes[asked[Q_BODY]], meshes[asked[Q_PARTNER]], header);
    return address_of(header);
}

int begin_meshes(collide_robot_workspace *space)
{
    const collide_robot *robot = space->robot;
    const int64_t *n = robot->sizes, stride = n[F_AROUND] + n[F_BODIES];
    int64_t m[MEASURES], wide = stride + MAX_OBJECTS, *words, *walks, k;
    if (n[F_HAS_MESHES] == 0) return 1;
    if (!workspace_sizes(robot->kernels, m) || collide_workspace_create(&space->pairs) != COLLIDE_OK) return 0;
    words = arena_zeroed(&space->arena, (size_t)(QUESTIONS + QUESTION * (n[F_BODIES] + MAX_OBJECTS) * wide), 8);
    if (words == NULL || (walks = begin_walks(space, m)) == NULL) return 0;
    words[MEET_CODE] = code_at(&robot->kernels->meet_poses);
    words[GAP_CODE] = code_at(&robot->kernels->gap_poses);
    words[STRIDE] = wide; /* behind the file's bodies are objects, whose pairs with meshes are left to Python */
    for (k = 0; k < n[F_BODIES] * stride; k++) {
        const int64_t *asked = robot->questions + QUESTION_OF_FILE * k;
        int64_t *question = words + QUESTIONS + QUESTION * (k / stride * wide + k % stride);
        question[HOW] = asked[Q_HOW];
        question[HEADER_AT] = header_of(space, m, asked, walks);
        question[POSE_ROW] = asked[Q_ROW];
        if (question[HEADER_AT] == -1) return 0;
    }
    space->scene[MESH_QUESTIONS_AT] = address_of(words);
    space->scene[MESH_POSES_AT] = address_of(arena_zeroed(&space->arena, 2 * 16, sizeof(double)));
    space->scene[MESH_ROW_AT] = address_of(arena_zeroed(&space->arena, 2, sizeof(collide_pair)));
    return 1;
}
