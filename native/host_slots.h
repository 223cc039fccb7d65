/* Workspaces of a hook: a thread takes one that is free for the length of a call. */
#ifndef COLLIDE_HOST_SLOTS_H
#define COLLIDE_HOST_SLOTS_H

#include "host_terrain.h"

#if defined(_MSC_VER)
#include <intrin.h>
typedef volatile long lock;
#define TAKEN(place) (_InterlockedExchange((place), 1) != 0)
#define GIVE_BACK(place) _InterlockedExchange((place), 0)
#define PUBLISH() _ReadWriteBarrier()
#else
typedef volatile int lock;
#define TAKEN(place) (__sync_lock_test_and_set((place), 1) != 0)
#define GIVE_BACK(place) __sync_lock_release(place)
#define PUBLISH() __sync_synchronize()
#endif

enum { MAX_CONTACTS = 50 };

struct slot {
    lock taken;
    collide_workspace *space;
    struct manifold_space manifold;
    struct terrain_space *terrain; /* NULL until a height field is asked about */
    collide_contact rows[MAX_CONTACTS];
};

/* A workspace nobody else has, with room for faces of so many corners; NULL where there is no memory. */
struct slot *take_slot(int64_t largest);
void give_slot_back(struct slot *slot);

/* Whether it has room for height fields; 0 where there is no memory. */
int has_terrain_space(struct slot *slot);

/* Free what no thread works with. */
void free_slots(void);

#endif
