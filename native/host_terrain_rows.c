/* Rows of contacts with a height field: each once, and of many those that tell most. */
#include "host_terrain_task.h"

/* Rows that are not there yet, up to the margin. */
void keep_rows(const struct task *task, const collide_contact *rows, int64_t n)
{
    struct terrain_space *own = task->own;
    double near = 4.0 * task->tolerance * task->tolerance;
    int64_t k;
    for (k = 0; k < n && own->n_rows < MAX_ROWS; k++) {
        int i = 0;
        if (rows[k].distance > task->pair->margin) continue;
        while (i < own->n_rows && !(square_between(own->rows[i].point_a, rows[k].point_a) <= near &&
                                    dot3(own->rows[i].normal, rows[k].normal) > SAME_NORMAL))
            i++;
        if (i == own->n_rows) own->rows[own->n_rows++] = rows[k];
        else if (rows[k].distance < own->rows[i].distance) own->rows[i] = rows[k];
    }
}

/* Of the rows whose normal is that of the deepest left, that one and those farthest from all kept, into `out`; how many. The others of
   this normal are dropped. */
static int64_t take_patch(collide_contact *rows, int *n_rows, int64_t most, collide_contact *out)
{
    double away[MAX_ROWS];
    int members[MAX_ROWS], n = 0, deepest = 0, k, left = 0;
    int64_t count = 0;
    for (k = 1; k < *n_rows; k++)
        if (rows[k].distance < rows[deepest].distance) deepest = k;
    for (k = 0; k < *n_rows; k++)
        if (dot3(rows[k].normal, rows[deepest].normal) > SAME_NORMAL) {
            away[n] = k == deepest ? INFINITE : -1.0;
            members[n++] = k;
        }
    while (count < most) {
        int best = -1;
        for (k = 0; k < n; k++)
            if (away[k] != 0.0 && (best < 0 || away[k] > away[best])) best = k;
        if (best < 0) break;
        out[count++] = rows[members[best]];
        away[best] = 0.0;
        for (k = 0; k < n; k++) {
            double square = square_between(rows[members[k]].point_a, rows[members[best]].point_a);
            if (away[k] < 0.0 || square < away[k]) away[k] = square;
        }
    }
    for (k = 0; k < *n_rows; k++)
        if (!(dot3(rows[k].normal, out[0].normal) > SAME_NORMAL)) rows[left++] = rows[k];
    *n_rows = left;
    return count;
}

int64_t take_rows(struct terrain_space *own, int64_t max_contacts, collide_contact *rows)
{
    int64_t n = 0;
    while (own->n_rows > 0 && n < max_contacts) {
        int64_t most = max_contacts - n < PER_PATCH ? max_contacts - n : PER_PATCH;
        n += take_patch(own->rows, &own->n_rows, most, rows + n);
    }
    return n;
}
