/* A toy simulator: boxes fall on a floor and come to rest on each other. A world finds the contacts, and sequential impulses with
   friction, warmed by those of the step before, keep bodies from going on into each other.

   make && ./falling_boxes */
#include <collide.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BOXES = 6, MOST = 256, ROUNDS = 20, STEPS = 600 };

static const double DT = 1.0 / 120.0, GRAVITY = 9.81, FRICTION = 0.6; /* [s], [m/s^2] */
static const double MARGIN = 0.01, SLOP = 0.0005, PUSH = 0.2;         /* [m], [m], part of an overlap that a step takes back */
static const double SIZE[3] = {0.5, 0.4, 0.3}, MASS = 20.0;           /* [m], [kg] */

struct body {
    double p[3], q[4];      /* place, and quaternion w x y z */
    double v[3], w[3];      /* velocities in W */
    double inverse[3][3];   /* of the inertia, in W */
    double inverse_mass;    /* 0 of what stays */
};

/* A contact with its impulses: along the normal and along two tangents. */
struct joint {
    const collide_contact *contact;
    double axis[3][3], arm_a[3], arm_b[3], mass[3], impulse[3];
};

static void require(collide_status status, const char *message)
{
    if (status == COLLIDE_OK) return;
    fprintf(stderr, "%s: %s\n", collide_status_text(status), message);
    exit(1);
}

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double *a, const double *b, double *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* The pose of a body, and its inertia turned with it. */
static void take_pose(struct body *body, double *X)
{
    const double *q = body->q, w = q[0], x = q[1], y = q[2], z = q[3];
    const double R[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                            {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                            {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    int i, j, k;
    memset(X, 0, 16 * sizeof *X);
    X[15] = 1.0;
    for (i = 0; i < 3; i++) {
        X[4 * i + 3] = body->p[i];
        for (j = 0; j < 3; j++) {
            X[4 * i + j] = R[i][j];
            body->inverse[i][j] = 0.0;
            for (k = 0; k < 3; k++) {
                double square = dot(SIZE, SIZE) - SIZE[k] * SIZE[k];
                body->inverse[i][j] += R[i][k] * R[j][k] * 12.0 * body->inverse_mass / square;
            }
        }
    }
}

static void turn(const struct body *body, const double *torque, double *out)
{
    int i;
    for (i = 0; i < 3; i++) out[i] = dot(body->inverse[i], torque);
}

/* An impulse at an arm from a body's middle. */
static void push(struct body *body, const double *axis, const double *arm, double impulse)
{
    double torque[3], spin[3];
    int i;
    cross(arm, axis, torque);
    turn(body, torque, spin);
    for (i = 0; i < 3; i++) {
        body->v[i] += body->inverse_mass * impulse * axis[i];
        body->w[i] += impulse * spin[i];
    }
}

static void push_both(struct body *bodies, const struct joint *joint, int k, double impulse)
{
    push(&bodies[joint->contact->a], joint->axis[k], joint->arm_a, -impulse);
    push(&bodies[joint->contact->b], joint->axis[k], joint->arm_b, impulse);
}

static double speed_along(const struct body *body, const double *arm, const double *axis)
{
    double round[3];
    cross(body->w, arm, round);
    return dot(body->v, axis) + dot(round, axis);
}

/* What an impulse along an axis changes in the speed along it. */
static double answer_of(const struct body *body, const double *arm, const double *axis)
{
    double torque[3], spin[3];
    cross(arm, axis, torque);
    turn(body, torque, spin);
    return body->inverse_mass + dot(torque, spin);
}

/* Axes and arms of a contact, with the impulses that it had in the step before, which its bodies and features tell. */
static void begin_joint(struct joint *joint, struct body *bodies, const collide_contact *contact, const struct joint *before,
                        const collide_contact *rows_before, size_t n_before)
{
    const double *n = contact->normal;
    const double away[3] = {fabs(n[0]) < 0.7, !(fabs(n[0]) < 0.7), 0.0};
    const struct body *a = &bodies[contact->a], *b = &bodies[contact->b];
    double length;
    size_t j;
    int i, k;
    memset(joint, 0, sizeof *joint);
    joint->contact = contact;
    memcpy(joint->axis[0], n, sizeof joint->axis[0]);
    cross(n, away, joint->axis[1]);
    length = sqrt(dot(joint->axis[1], joint->axis[1]));
    for (i = 0; i < 3; i++) joint->axis[1][i] /= length;
    cross(n, joint->axis[1], joint->axis[2]);
    for (i = 0; i < 3; i++) {
        joint->arm_a[i] = contact->point_a[i] - a->p[i];
        joint->arm_b[i] = contact->point_b[i] - b->p[i];
    }
    for (k = 0; k < 3; k++)
        joint->mass[k] = 1.0 / (answer_of(a, joint->arm_a, joint->axis[k]) + answer_of(b, joint->arm_b, joint->axis[k]));
    for (j = 0; j < n_before; j++) {
        const collide_contact *row = &rows_before[j];
        if (row->a == contact->a && row->b == contact->b && row->feature_a == contact->feature_a &&
            row->feature_b == contact->feature_b)
            memcpy(joint->impulse, before[j].impulse, sizeof joint->impulse);
    }
    for (k = 0; k < 3; k++) push_both(bodies, joint, k, joint->impulse[k]);
}

/* One round: bodies part so fast that no gap is used up in a step, and an overlap slowly goes away; friction is within its
   bounds. */
static void solve(struct joint *joint, struct body *bodies)
{
    const struct body *a = &bodies[joint->contact->a], *b = &bodies[joint->contact->b];
    double gap = joint->contact->distance, least = gap > 0.0 ? -gap / DT : gap < -SLOP ? -PUSH * (gap + SLOP) / DT : 0.0;
    int k;
    for (k = 0; k < 3; k++) {
        double speed = speed_along(b, joint->arm_b, joint->axis[k]) - speed_along(a, joint->arm_a, joint->axis[k]);
        double before = joint->impulse[k], most = FRICTION * joint->impulse[0];
        double after = before - joint->mass[k] * (speed - (k == 0 ? least : 0.0));
        if (k == 0) after = after > 0.0 ? after : 0.0;
        else after = after > most ? most : after < -most ? -most : after;
        joint->impulse[k] = after;
        push_both(bodies, joint, k, after - before);
    }
}

static void advance(struct body *body)
{
    const double *w = body->w, q[4] = {body->q[0], body->q[1], body->q[2], body->q[3]};
    double length = 0.0;
    int i;
    for (i = 0; i < 3; i++) body->p[i] += DT * body->v[i];
    body->q[0] -= 0.5 * DT * (w[0] * q[1] + w[1] * q[2] + w[2] * q[3]);
    body->q[1] += 0.5 * DT * (w[0] * q[0] + w[1] * q[3] - w[2] * q[2]);
    body->q[2] += 0.5 * DT * (w[1] * q[0] + w[2] * q[1] - w[0] * q[3]);
    body->q[3] += 0.5 * DT * (w[2] * q[0] + w[0] * q[2] - w[1] * q[1]);
    for (i = 0; i < 4; i++) length += body->q[i] * body->q[i];
    for (i = 0; i < 4; i++) body->q[i] /= sqrt(length);
}

int main(void)
{
    static struct joint joints[2][MOST];
    static collide_contact rows[2][MOST];
    struct body bodies[BOXES + 1]; /* by id: the floor is 0 */
    double poses[16 * (BOXES + 1)], fastest = 0.0;
    const double up[3] = {0.0, 0.0, 1.0};
    collide_body made = COLLIDE_BODY_DEFAULT;
    collide_shape *floor = NULL, *box = NULL;
    collide_workspace *workspace = NULL;
    collide_world *world = NULL;
    int32_t ids[BOXES + 1];
    size_t n = 0, n_before = 0, k;
    int step, i, now = 0;

    require(collide_halfspace(up, 0.0, &floor), "floor");
    require(collide_box(SIZE, &box), "box");
    require(collide_workspace_create(&workspace), "workspace");
    require(collide_world_create(&world), "world");
    memset(bodies, 0, sizeof bodies);
    for (i = 0; i <= BOXES; i++) {
        bodies[i].q[0] = 1.0;
        bodies[i].inverse_mass = i > 0 ? 1.0 / MASS : 0.0;
        if (i > 0) { /* one above the other with gaps, a little beside each other */
            bodies[i].p[0] = 0.03 * (i % 3 - 1);
            bodies[i].p[1] = 0.02 * (i % 2);
            bodies[i].p[2] = 0.35 * i;
        }
        take_pose(&bodies[i], poses + 16 * i);
        made.shape = i > 0 ? box : floor;
        made.is_static = i == 0;
        made.X_WB = poses + 16 * i;
        require(collide_world_add(world, &made, 1, &ids[i]), collide_world_message(world));
    }
    for (step = 0; step < STEPS; step++, n_before = n, now = !now) {
        for (i = 1; i <= BOXES; i++) bodies[i].v[2] -= DT * GRAVITY;
        require(collide_world_contacts(world, workspace, MARGIN, 8, rows[now], MOST, &n), collide_workspace_message(workspace));
        for (k = 0; k < n; k++) begin_joint(&joints[now][k], bodies, &rows[now][k], joints[!now], rows[!now], n_before);
        for (i = 0; i < ROUNDS; i++)
            for (k = 0; k < n; k++) solve(&joints[now][k], bodies);
        for (i = 1; i <= BOXES; i++) {
            advance(&bodies[i]);
            take_pose(&bodies[i], poses + 16 * i);
        }
        require(collide_world_move(world, ids + 1, BOXES, poses + 16), collide_world_message(world));
        if (step % 100 == 99)
            printf("%.2f s: %2d contacts, the top box is at %.4f m\n", (step + 1) * DT, (int)n, bodies[BOXES].p[2]);
    }
    for (i = 1; i <= BOXES; i++) fastest = fmax(fastest, sqrt(dot(bodies[i].v, bodies[i].v) + dot(bodies[i].w, bodies[i].w)));
    printf("at rest: %s; a stack of %d boxes is %.3f m high\n", fastest < 1e-3 ? "yes" : "no", BOXES,
           bodies[BOXES].p[2] + 0.5 * SIZE[2]);

    collide_world_free(world);
    collide_workspace_free(workspace);
    collide_shape_free(box);
    collide_shape_free(floor);
    return 0;
}
