/* Workspaces of a hook. */
#include "host_slots.h"

enum { SLOTS = 128 };

static struct slot slots[SLOTS];

/* Threads begin looking at different places. */
struct slot *take_slot(int64_t largest)
{
    int local;
    size_t k = ((uintptr_t)&local >> 16) % SLOTS;
    struct slot *slot;
    while (TAKEN(&slots[k].taken)) k = (k + 1) % SLOTS;
    slot = &slots[k];
    if (slot->space == NULL && collide_workspace_create(&slot->space) == COLLIDE_OK) begin_manifolds(&slot->manifold, slot->space);
    if (slot->space != NULL && fit_manifolds(&slot->manifold, largest)) return slot;
    give_slot_back(slot);
    return NULL;
}

void give_slot_back(struct slot *slot) { GIVE_BACK(&slot->taken); }

int has_terrain_space(struct slot *slot)
{
    if (slot->terrain == NULL) slot->terrain = begin_terrain_space();
    return slot->terrain != NULL;
}

void free_slots(void)
{
    int k;
    for (k = 0; k < SLOTS; k++) {
        if (TAKEN(&slots[k].taken)) continue; /* a thread is still at work: its memory stays */
        collide_workspace_free(slots[k].space);
        slots[k].space = NULL;
        free_manifolds(&slots[k].manifold);
        free_terrain_space(slots[k].terrain);
        slots[k].terrain = NULL;
        give_slot_back(&slots[k]);
    }
}
