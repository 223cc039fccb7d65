/* The box-tree over the bodies of a world, brought up to date by each change, as collide/broadphase/tree_over_bodies.py does.
   No answer depends on which tree it is. */
#include "capi_world.h"

#include <math.h>

/* Trees are made anew once all sides of their nodes, added up, have grown by this factor. Below so many bodies, or where more
   than one leaf in so many has changed, all nodes are fitted at once. */
static const double GROWN = 1.5;
enum { MIN_PATHS = 64, SHARE_OF_PATHS = 8 };

static double *box_of(const collide_world *world, int64_t body) { return world->boxes + 6 * body; }

static int is_bounded(const collide_world *world, int64_t body)
{
    const double *box = box_of(world, body);
    int k;
    for (k = 0; k < 6; k++)
        if (!(fabs(box[k]) < INFINITE)) return 0;
    return 1;
}

static int is_fixed(const collide_world *world, int64_t body) { return (world->traits[TRAITS * body + FLAGS] & STATIC_BIT) != 0; }

/* A box that meets nothing, or everything. */
static void set_infinite(double *box, double low)
{
    int k;
    for (k = 0; k < 6; k++) box[k] = k < 3 ? low : -low;
}

static void set_box_infinite(collide_world *world, int64_t body, double low)
{
    set_infinite(box_of(world, body), low);
    set_infinite(world->widened + 6 * body, low);
}

static void put_leaf(collide_world *world, int64_t body)
{
    memcpy(world->tree.nodes + 6 * world->leaf_of[body], tree_boxes(world) + 6 * body, 6 * sizeof(double));
}

static int64_t n_nodes(const struct body_tree *tree) { return tree->sections[tree->n_sections]; }

/* Nodes that there is room for: of all bodies twice as many at most, and some of bodies removed. */
static int64_t node_capacity(const collide_world *world) { return 3 * (int64_t)world->capacity; }

void tree_header(const collide_world *world, int64_t header[TREE_HEADER])
{
    header[T_NODES_AT] = address_of(world->tree.nodes);
    header[T_LINKS_AT] = address_of(world->tree.links);
    header[T_N_NODES] = n_nodes(&world->tree);
    header[T_N_FIXED] = world->tree.n_fixed;
    header[T_BOXES_AT] = address_of(tree_boxes(world));
    header[T_N_BOXES] = (int64_t)world->n;
    header[T_TRAITS_AT] = address_of(world->traits);
    header[T_ALLOWED_AT] = address_of(world->allowed_rows);
    header[T_N_ALLOWED] = (int64_t)world->n_allowed;
    header[T_LEAF_OF_AT] = address_of(world->leaf_of);
    header[T_CHANGED_AT] = address_of(world->changed);
    header[T_N_CHANGED] = world->n_changed;
}

double spacing_of(const struct body_tree *tree)
{
    double sides = 0.0;
    int64_t inner = 0;
    size_t k;
    for (k = 0; k < tree->n_sections; k++) {
        sides += tree->sides[k];
        inner += tree->n_inner[k];
    }
    return sides / (double)(inner > 0 ? 3 * inner : 1);
}

static double all_sides(const struct body_tree *tree)
{
    double sides = 0.0;
    size_t k;
    for (k = 0; k < tree->n_sections; k++) sides += tree->sides[k];
    return sides;
}

static double fit(collide_world *world, size_t section)
{
    struct body_tree *tree = &world->tree;
    return world->kernels->fit_inner_nodes(address_of(tree->links), address_of(tree->nodes), tree->sections[section],
                                           tree->sections[section + 1]);
}

/* A tree over m > 0 bodies, which are brought into the order of its leaves, behind the others. */
static void add_section(collide_world *world, int64_t *bodies, int64_t m)
{
    struct body_tree *tree = &world->tree;
    int64_t begin = n_nodes(tree), node, end;
    end = world->kernels->grow_graded(address_of(bodies), m, address_of(tree_boxes(world)), (int64_t)world->n, begin,
                                      address_of(tree->links), node_capacity(world), address_of(tree->scratch));
    for (node = begin; node < end; node++) {
        int64_t body = tree->links[LINK * node + BODY];
        if (body < 0) continue;
        world->leaf_of[body] = node;
        put_leaf(world, body);
    }
    tree->n_inner[tree->n_sections] = end - begin - m;
    tree->sections[++tree->n_sections] = end;
    tree->sides[tree->n_sections - 1] = fit(world, tree->n_sections - 1);
}

/* A tree over all bodies that have an end and are fixed, or are not. */
static void add_all(collide_world *world, int fixed)
{
    int64_t body, m = 0;
    for (body = 0; body < (int64_t)world->n; body++)
        if (world->is_alive[body] && is_bounded(world, body) && is_fixed(world, body) == fixed) world->numbers[m++] = body;
    if (m > 0) add_section(world, world->numbers, m);
}

void make_trees(collide_world *world)
{
    struct body_tree *tree = &world->tree;
    int64_t body;
    world->n_unbounded = 0;
    for (body = 0; body < (int64_t)world->n; body++) {
        world->leaf_of[body] = -1;
        if (!world->is_alive[body]) set_box_infinite(world, body, INFINITE);
        else if (!is_bounded(world, body)) {
            set_box_infinite(world, body, -INFINITE);
            world->unbounded[world->n_unbounded++] = body;
        }
    }
    tree->n_sections = tree->n_holes = 0;
    tree->sections[0] = 0;
    add_all(world, 1);
    tree->n_fixed = n_nodes(tree);
    add_all(world, 0);
    tree->least = all_sides(tree);
}

/* Make the trees anew where their nodes have become much larger. */
static void look_at_sides(collide_world *world)
{
    struct body_tree *tree = &world->tree;
    double sides = all_sides(tree);
    if (sides > GROWN * tree->least) make_trees(world);
    else if (sides < tree->least) tree->least = sides;
}

/* Nodes above bodies whose leaves have other boxes. Bodies are written over. */
static void refit_above(collide_world *world, int64_t *bodies, int64_t n)
{
    struct body_tree *tree = &world->tree;
    size_t section;
    int64_t k;
    double looked_at;
    if (n == 0) return;
    if (world->n < MIN_PATHS || SHARE_OF_PATHS * (size_t)n > world->n)
        for (section = 0; section < tree->n_sections; section++) tree->sides[section] = fit(world, section);
    else {
        for (k = 0; k < n; k++) bodies[k] = world->leaf_of[bodies[k]];
        tree->sides[0] += world->kernels->fit_paths(address_of(bodies), n, address_of(tree->links), address_of(tree->nodes),
                                                    n_nodes(tree), address_of(&looked_at));
    }
    look_at_sides(world);
}

void add_to_trees(collide_world *world, size_t first)
{
    struct body_tree *tree = &world->tree;
    size_t least_sections = tree->n_fixed > 0;
    int64_t body, node, m = 0;
    double before = all_sides(tree), grown;
    for (body = (int64_t)first; body < (int64_t)world->n; body++) {
        if (is_bounded(world, body)) world->numbers[m++] = body;
        else {
            set_box_infinite(world, body, -INFINITE);
            world->unbounded[world->n_unbounded++] = body;
        }
    }
    if (m == 0) return;
    while (tree->n_sections > least_sections) { /* the last trees are made one with it where they are not much larger */
        int64_t begin = tree->sections[tree->n_sections - 1], end = n_nodes(tree);
        if (end - begin > 4 * m) break;
        for (node = begin; node < end; node++)
            if (tree->links[LINK * node + BODY] >= 0) world->numbers[m++] = tree->links[LINK * node + BODY];
        tree->n_sections--;
    }
    if (tree->n_sections == MAX_SECTIONS || n_nodes(tree) + 2 * m > node_capacity(world)) {
        make_trees(world);
        return;
    }
    add_section(world, world->numbers, m);
    grown = all_sides(tree) - before;
    if (grown > 0.0) tree->least += grown;
    look_at_sides(world);
}

void take_from_trees(collide_world *world, int64_t body)
{
    struct body_tree *tree = &world->tree;
    int64_t leaf = world->leaf_of[body], changed = body;
    size_t k, n = 0;
    set_box_infinite(world, body, INFINITE);
    if (leaf < 0) {
        for (k = 0; k < world->n_unbounded; k++)
            if (world->unbounded[k] != body) world->unbounded[n++] = world->unbounded[k];
        world->n_unbounded = n;
        return;
    }
    set_infinite(tree->nodes + 6 * leaf, INFINITE);
    tree->links[LINK * leaf + BODY] = -1;
    if (4 * (int64_t)++tree->n_holes > n_nodes(tree) + 128) make_trees(world);
    else refit_above(world, &changed, 1);
    world->leaf_of[body] = -1;
}

void widen_leaves(collide_world *world)
{
    size_t section;
    int64_t body;
    for (body = 0; body < (int64_t)world->n; body++) {
        widen_box(world, body);
        if (world->leaf_of[body] >= 0) put_leaf(world, body);
    }
    for (section = 0; section < world->tree.n_sections; section++) world->tree.sides[section] = fit(world, section);
    look_at_sides(world);
}

/* Give n bodies' leaves their boxes with room for margins, and leave these bodies in `bodies`: how many, or -1 where a box has no end
   any more, or has one now. */
static int64_t move_widened(collide_world *world, int64_t *bodies, int64_t n)
{
    int64_t k, n_leaves = 0;
    for (k = 0; k < n; k++) {
        int64_t body = bodies[k], has_leaf = world->leaf_of[body] >= 0;
        widen_box(world, body);
        if (is_bounded(world, body) != has_leaf) return -1;
        if (!has_leaf) continue;
        put_leaf(world, body);
        bodies[n_leaves++] = body;
    }
    return n_leaves;
}

void move_flagged(collide_world *world, int with_tree)
{
    int64_t tree[TREE_HEADER], parts[SINGLE_PARTS], n, k;
    int has_margins = world->widest > 0.0;
    parts[P_INTS_AT] = address_of(world->table.ints);
    parts[P_NUMBERS_AT] = address_of(world->table.numbers);
    parts[P_ROW_OF_AT] = address_of(world->row_of);
    parts[P_POSES_AT] = address_of(world->poses);
    parts[P_BOXES_AT] = address_of(world->boxes);
    parts[P_N_BODIES] = (int64_t)world->n;
    tree_header(world, tree);
    n = world->kernels->move_single_parts(address_of(parts), address_of(world->X_WBs), address_of(world->is_moved),
                                          with_tree && !has_margins ? address_of(tree) : 0, spacing_of(&world->tree), address_of(world->numbers));
    world->n_changed = tree[T_N_CHANGED];
    if (has_margins && with_tree) n = move_widened(world, world->numbers, n);
    else
        for (k = 0; k < n && has_margins; k++) widen_box(world, world->numbers[k]);
    if (with_tree && n >= 0) refit_above(world, world->numbers, n);
    else if (n < 0) { /* a box that has no end any more, or has one now: all of them, and trees, anew */
        memcpy(world->is_moved, world->is_alive, world->n);
        move_flagged(world, 0);
        make_trees(world);
    }
}
