/* What leaves the library. */
#ifndef COLLIDE_EXPORT
#if defined(_WIN32)
#define COLLIDE_EXPORT __declspec(dllexport)
#else
#define COLLIDE_EXPORT __attribute__((visibility("default")))
#endif
#endif
