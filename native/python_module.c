/* collide.kernels._glue: the kernels of libcollide as Python functions. The build says of which interface of CPython's
   (native/platforms.py): the limited one of 3.10; of builds without the lock the one of 3.15 that all builds load
   (abi3t), or, before, that of the very version.

   The library is opened by its path, after Python has looked at its size and checksum. Numpy's arrays are read through
   numpy's own C interface. */
#include <Python.h>

#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#if defined(Py_TARGET_ABI3T)
#define NPY_TARGET_VERSION NPY_2_5_API_VERSION
#else
#define NPY_TARGET_VERSION NPY_1_22_API_VERSION
#endif
#include <numpy/arrayobject.h>

#include <stdint.h>
#include <string.h>
#if defined(_WIN32)
#include <windows.h>
#else
#include <dlfcn.h>
#endif

#include "collide.h"
#include "kernels.h"
#include "kernels_of_level.h"

/* Written while `collide` is imported, and read by all threads later. */
static const struct collide_kernels *kernels = NULL;
/* Whether threads run Python at once: then each makes its pairs ready for itself (collide/narrowphase/prepared_pairs.py). */
static int by_thread = 0;
static const char *const kernel_names[] = {COLLIDE_KERNEL_NAMES};

/* --- arguments ---------------------------------------------------------------------------------------------------- */

static PyObject *wrong_count(const char *name, int wanted, Py_ssize_t n)
{
    PyErr_Format(PyExc_TypeError, "%s takes %d arguments, got %zd", name, wanted, n);
    return NULL;
}

static int integer_of(PyObject *given, int64_t *out)
{
    *out = PyLong_AsLongLong(given);
    return *out == -1 && PyErr_Occurred() != NULL ? -1 : 0;
}

static int double_of(PyObject *given, double *out)
{
    *out = PyFloat_AsDouble(given);
    return *out == -1.0 && PyErr_Occurred() != NULL ? -1 : 0;
}

static int truth_of(PyObject *given, uint8_t *out)
{
    int truth = given == Py_True ? 1 : given == Py_False ? 0 : PyObject_IsTrue(given);
    *out = (uint8_t)truth;
    return truth;
}

#include "entries.inc"

/* --- single calls -------------------------------------------------------------------------------------------------- */

/* The 16 doubles of a C-contiguous (4, 4) array of float64; NULL of anything else. */
static void *matrix_of(PyObject *given)
{
    PyArrayObject *array = (PyArrayObject *)given;
    if (!PyArray_CheckExact(given) || PyArray_TYPE(array) != NPY_DOUBLE || PyArray_NDIM(array) != 2) return NULL;
    if (PyArray_DIM(array, 0) != 4 || PyArray_DIM(array, 1) != 4 || !PyArray_ISCARRAY_RO(array)) return NULL;
    return PyArray_DATA(array);
}

static PyObject *answer_of(int64_t result)
{
    return result < 0 ? Py_NewRef(Py_None) : Py_NewRef(result ? Py_True : Py_False);
}

/* self : the array of a header. */
#define HEADER(self) ((int64_t)(intptr_t)PyArray_DATA((PyArrayObject *)(self)))

#define SINGLE_BOOLEAN(name)                                                                                             \
    static PyObject *single_##name(PyObject *self, PyObject *const *given, Py_ssize_t n)                                 \
    {                                                                                                                    \
        void *A, *B;                                                                                                     \
        if (n != 2) return wrong_count(#name, 2, n);                                                                     \
        A = matrix_of(given[0]);                                                                                         \
        B = matrix_of(given[1]);                                                                                         \
        if (A == NULL || B == NULL) Py_RETURN_NONE;                                                                      \
        return answer_of(kernels->name(HEADER(self), (int64_t)(intptr_t)A, (int64_t)(intptr_t)B));                       \
    }

#define SINGLE_WITHIN(name)                                                                                             \
    static PyObject *single_##name(PyObject *self, PyObject *const *given, Py_ssize_t n)                                \
    {                                                                                                                   \
        void *A, *B;                                                                                                    \
        double length;                                                                                                  \
        if (n != 3) return wrong_count(#name, 3, n);                                                                    \
        A = matrix_of(given[0]);                                                                                        \
        B = matrix_of(given[1]);                                                                                        \
        if (A == NULL || B == NULL) Py_RETURN_NONE;                                                                     \
        if (double_of(given[2], &length) < 0) return NULL;                                                              \
        return answer_of(kernels->name(HEADER(self), (int64_t)(intptr_t)A, (int64_t)(intptr_t)B, length));              \
    }

#define SINGLE_ROW(name)                                                                                                \
    static PyObject *single_##name(PyObject *self, PyObject *const *given, Py_ssize_t n)                                \
    {                                                                                                                   \
        void *A, *B;                                                                                                    \
        double limit;                                                                                                   \
        uint8_t flag;                                                                                                   \
        if (n != 5) return wrong_count(#name, 5, n);                                                                    \
        A = matrix_of(given[0]);                                                                                        \
        B = matrix_of(given[1]);                                                                                        \
        if (A == NULL || B == NULL) Py_RETURN_NONE;                                                                     \
        if (!PyByteArray_CheckExact(given[2]) || PyByteArray_Size(given[2]) < (Py_ssize_t)sizeof(collide_pair)) {       \
            PyErr_SetString(PyExc_TypeError, #name ": the answer goes into a bytearray with space for a row");          \
            return NULL;                                                                                                \
        }                                                                                                               \
        if (truth_of(given[3], &flag) < 0 || double_of(given[4], &limit) < 0) return NULL;                              \
        return answer_of(kernels->name(HEADER(self), (int64_t)(intptr_t)A, (int64_t)(intptr_t)B,                        \
                                       (int64_t)(intptr_t)PyByteArray_AsString(given[2]), flag, limit));                \
    }

/* self : the array of a header, and that of rows to write into. */
#define SINGLE_CONTACTS(name)                                                                                           \
    static PyObject *single_##name(PyObject *self, PyObject *const *given, Py_ssize_t n)                                \
    {                                                                                                                   \
        PyArrayObject *rows = (PyArrayObject *)PyTuple_GetItem(self, 1);                                                \
        void *A, *B;                                                                                                    \
        double margin;                                                                                                  \
        int64_t most, found;                                                                                            \
        if (n != 4) return wrong_count(#name, 4, n);                                                                    \
        A = matrix_of(given[0]);                                                                                        \
        B = matrix_of(given[1]);                                                                                        \
        if (A == NULL || B == NULL) Py_RETURN_NONE;                                                                     \
        if (integer_of(given[2], &most) < 0 || double_of(given[3], &margin) < 0) return NULL;                           \
        memset(PyArray_DATA(rows), 0, (size_t)((most < PyArray_SIZE(rows) ? most : PyArray_SIZE(rows)) * PyArray_ITEMSIZE(rows)));\
        found = kernels->name(HEADER(PyTuple_GetItem(self, 0)), (int64_t)(intptr_t)A, (int64_t)(intptr_t)B,             \
                              (int64_t)(intptr_t)PyArray_DATA(rows), most, margin);                                     \
        if (found < 0) Py_RETURN_NONE;                                                                                  \
        return PyBytes_FromStringAndSize(PyArray_DATA(rows), (Py_ssize_t)found * PyArray_ITEMSIZE(rows));               \
    }

SINGLES

#define SINGLE_METHOD(name) {#name, (PyCFunction)(void (*)(void))single_##name, METH_FASTCALL, NULL},
static PyMethodDef single_methods[] = {SINGLE_METHODS{NULL, NULL, 0, NULL}};

static int is_written_array(PyObject *given) { return PyArray_Check(given) && PyArray_ISCARRAY((PyArrayObject *)given); }

/* prepared(name, header[, rows]): the function of a single call with its header, and of contacts the rows that the kernel writes,
   held as long as the function lives. */
static PyObject *prepared(PyObject *module, PyObject *arguments)
{
    const char *name;
    PyObject *header, *rows = NULL, *self, *made = NULL;
    PyMethodDef *method;
    if (!PyArg_ParseTuple(arguments, "sO|O:prepared", &name, &header, &rows)) return NULL;
    if (!is_written_array(header) || PyArray_TYPE((PyArrayObject *)header) != NPY_INT64 || (rows != NULL && !is_written_array(rows))) {
        PyErr_SetString(PyExc_TypeError, "prepared: the header must be a contiguous array of int64, and rows one that can be written");
        return NULL;
    }
    for (method = single_methods; method->ml_name != NULL && strcmp(method->ml_name, name) != 0; method++) {}
    if (method->ml_name == NULL) {
        PyErr_Format(PyExc_ValueError, "prepared: %s is no kernel of single calls", name);
        return NULL;
    }
    if ((self = rows == NULL ? Py_NewRef(header) : PyTuple_Pack(2, header, rows)) == NULL) return NULL;
    made = PyCFunction_New(method, self);
    Py_DECREF(self);
    return made;
}

/* --- numbers of rows ----------------------------------------------------------------------------------------------- */

static PyObject *vector_of(const double *values)
{
    npy_intp length = 3;
    PyObject *vector = PyArray_SimpleNew(1, &length, NPY_DOUBLE);
    if (vector != NULL) memcpy(PyArray_DATA((PyArrayObject *)vector), values, 3 * sizeof *values);
    return vector;
}

static PyObject *middle_of(const double *a, const double *b)
{
    double middle[3];
    int k;
    for (k = 0; k < 3; k++) middle[k] = 0.5 * a[k] + 0.5 * b[k];
    return vector_of(middle);
}

/* row_fields(row): (distance, normal, point_a, point_b, their middle, part_a, part_b, hit) of bytes that begin with a row of PAIR_DTYPE.
   Vectors are arrays (3,) of their own. */
static PyObject *row_fields(PyObject *module, PyObject *given)
{
    const collide_pair *row = NULL;
    if (PyByteArray_Check(given) && PyByteArray_Size(given) >= (Py_ssize_t)sizeof *row)
        row = (const collide_pair *)(const void *)PyByteArray_AsString(given);
    else if (PyBytes_Check(given) && PyBytes_Size(given) >= (Py_ssize_t)sizeof *row)
        row = (const collide_pair *)(const void *)PyBytes_AsString(given);
    if (row == NULL) {
        PyErr_SetString(PyExc_TypeError, "row_fields: bytes or a bytearray that begins with a row");
        return NULL;
    }
    return Py_BuildValue("dNNNNiiO", row->distance, vector_of(row->normal), vector_of(row->point_a), vector_of(row->point_b),
                         middle_of(row->point_a, row->point_b), row->part_a, row->part_b, row->hit ? Py_True : Py_False);
}

/* --- queries of two shapes at one pair of poses, and at many -------------------------------------------------------- */

enum word {
    PREPARED, SERIAL, SINGLE, COLLIDE, WITHIN, DISTANCE, CONTACTS, COLLIDE_POSES, DISTANCE_POSES, CHECK_POSES, THREADS, AXES, ALGORITHM,
    SECURITY_MARGIN, MAX_DISTANCE, MARGIN, SIGNED, MAX_CONTACTS, WORDS
};
static const char *const spelled[WORDS] = {
    "_prepared", "_serial", "_single", "collide", "within", "distance", "contacts", "collide_poses", "distance_poses", "check_poses",
    "threads", "axes", "algorithm", "security_margin", "max_distance", "margin", "signed", "max_contacts",
};
/* The same, interned, as names of attributes and arguments are, the last one NULL; and the one number of threads. */
static PyObject *words[WORDS + 1], *one = NULL;

/* A public function of Python's. It asks the pair that is ready for single calls (collide/narrowphase/prepared_pairs.py), and leaves to
   the function as Python has it what the pair does not answer, and whatever else is asked: collide/narrowphase/single_queries.py tells. */
struct query {
    PyMethodDef method;
    enum word length, option;   /* its own arguments: a length, and one that is none (WORDS where there is no such) */
    enum word none[2];          /* arguments that may be None (WORDS likewise) */
    double least, most;         /* of the length, unless it is 0 [m] */
    PyObject *function, *prepare, *result, *certify;
    PyObject *usual_length, *usual_option;
};

/* What is read of a call's named arguments; each borrowed, or NULL. */
struct options { PyObject *length, *option; };

/* 1 where the arguments are those of a single call; 0 where Python has to look at them. Names are compared by identity: others of the
   same spelling are for Python, too. */
static int read_options(const struct query *query, PyObject *names, PyObject *const *values, struct options *read)
{
    Py_ssize_t k, n = names == NULL ? 0 : PyTuple_Size(names);
    double length;
    read->length = query->usual_length;
    read->option = query->usual_option;
    for (k = 0; k < n; k++) {
        PyObject *name = PyTuple_GetItem(names, k), *value = values[k];
        if (name == words[query->length]) read->length = value;
        else if (name == words[query->option]) read->option = value;
        else if (name == words[CHECK_POSES] ? value != Py_True && value != Py_False
                 : name == words[THREADS]   ? value != one
                 : name == words[query->none[0]] || name == words[query->none[1]] ? value != Py_None
                                                                                   : 1)
            return 0;
    }
    if (read->length == query->usual_length) return 1;
    if (!PyFloat_Check(read->length) && !PyLong_CheckExact(read->length)) return 0;
    length = PyFloat_AsDouble(read->length);
    if (length == -1.0 && PyErr_Occurred() != NULL) PyErr_Clear(); /* too large: Python says so */
    return length == 0.0 || (length >= query->least && length <= query->most);
}

/* (1, the attribute, a new reference), (0, NULL) where there is none, (-1, NULL) with an exception. */
static int attribute_of(PyObject *owner, enum word name, PyObject **found)
{
    if ((*found = PyObject_GetAttr(owner, words[name])) != NULL) return 1;
    if (!PyErr_ExceptionMatches(PyExc_AttributeError)) return -1;
    PyErr_Clear();
    return 0;
}

#if defined(Py_LIMITED_API) && Py_LIMITED_API + 0 < 0x030D0000
/* Such builds hold the lock: nobody takes the item away before it is ours. */
static int PyDict_GetItemRef(PyObject *items, PyObject *key, PyObject **found)
{
    if ((*found = PyDict_GetItemWithError(items, key)) == NULL) return PyErr_Occurred() == NULL ? 0 : -1;
    Py_INCREF(*found);
    return 1;
}
#endif

/* What a pair is kept under: the number of B, and, where threads run at once, of this thread. Takes over the reference. */
static PyObject *key_of(PyObject *serial)
{
    PyObject *thread, *key;
    if (!by_thread) return serial;
    thread = PyLong_FromUnsignedLong(PyThread_get_thread_ident());
    key = thread == NULL ? NULL : PyTuple_Pack(2, serial, thread);
    Py_XDECREF(thread);
    Py_DECREF(serial);
    return key;
}

/* How the pair made ready of A and B answers a question, as `attribute_of` says; the attribute itself has to be there. */
static int kept_single_of(PyObject *A, PyObject *B, enum word question, PyObject **single)
{
    PyObject *pairs, *key, *pair = NULL;
    int found;
    *single = NULL;
    if ((found = attribute_of(A, PREPARED, &pairs)) <= 0) return found;
    if ((found = attribute_of(B, SERIAL, &key)) > 0) {
        if ((key = key_of(key)) == NULL) found = -1;
        else found = PyDict_CheckExact(pairs) ? PyDict_GetItemRef(pairs, key, &pair) : 0;
        Py_XDECREF(key);
        if (found > 0) found = (*single = PyObject_GetAttr(pair, words[question])) == NULL ? -1 : 1;
        Py_XDECREF(pair);
    }
    Py_DECREF(pairs);
    return found;
}

/* The same. Where the pair is not ready, or not for this question, and the poses are matrices, it is made ready now. */
static int single_of(const struct query *query, PyObject *const *given, enum word question, PyObject **single)
{
    int found = kept_single_of(given[0], given[1], question, single);
    PyObject *made;
    if (found < 0 || (found && *single != Py_None) || matrix_of(given[2]) == NULL || matrix_of(given[3]) == NULL) return found;
    if (found) Py_CLEAR(*single);
    if ((made = PyObject_CallFunctionObjArgs(query->prepare, given[0], given[1], NULL)) == NULL) return -1;
    Py_DECREF(made);
    return made == Py_True ? kept_single_of(given[0], given[1], question, single) : 0;
}

static PyObject *tuple_of(PyObject *const *items, Py_ssize_t n)
{
    PyObject *tuple = PyTuple_New(n);
    Py_ssize_t k;
    for (k = 0; tuple != NULL && k < n; k++) PyTuple_SetItem(tuple, k, Py_NewRef(items[k]));
    return tuple;
}

/* What a single function says; None where there is no such function. Takes over the reference to it. */
static PyObject *answer_of_single(PyObject *single, PyObject *const *arguments, Py_ssize_t n)
{
    PyObject *answer, *tuple;
    if (single == Py_None) return single;
    if (PyCFunction_CheckExact(single) && PyCFunction_GetFlags(single) == METH_FASTCALL) {
        typedef PyObject *(*fast)(PyObject *, PyObject *const *, Py_ssize_t);
        answer = ((fast)(void (*)(void))PyCFunction_GetFunction(single))(PyCFunction_GetSelf(single), arguments, n);
    } else {
        answer = (tuple = tuple_of(arguments, n)) == NULL ? NULL : PyObject_Call(single, tuple, NULL);
        Py_XDECREF(tuple);
    }
    Py_DECREF(single);
    return answer;
}

/* The poses of an array that kernels read as it is, (n, 4, 4) or (4, 4), C-contiguous and of float64; 0 of anything else. */
static Py_ssize_t poses_of(PyObject *given, int *is_batch)
{
    PyArrayObject *array = (PyArrayObject *)given;
    int axes;
    if (!PyArray_CheckExact(given) || PyArray_TYPE(array) != NPY_DOUBLE || !PyArray_ISCARRAY_RO(array)) return 0;
    axes = PyArray_NDIM(array);
    if ((axes != 2 && axes != 3) || PyArray_DIM(array, axes - 2) != 4 || PyArray_DIM(array, axes - 1) != 4) return 0;
    if (axes == 2) return 1;
    *is_batch = 1;
    return PyArray_DIM(array, 0);
}

/* Whether two arrays are a batch of poses, either of them perhaps a single pose that goes with all of the other's. */
static int are_batch(PyObject *X_WA, PyObject *X_WB)
{
    int is_batch = 0;
    Py_ssize_t a = poses_of(X_WA, &is_batch), b = poses_of(X_WB, &is_batch);
    return is_batch && a > 0 && b > 0 && (a == b || a == 1 || b == 1);
}

/* The answer of the function of Python, for the same arguments. */
static PyObject *long_way(const struct query *query, PyObject *const *given, Py_ssize_t n, PyObject *names)
{
    PyObject *arguments = tuple_of(given, n), *named = names == NULL ? NULL : PyDict_New(), *answer = NULL;
    Py_ssize_t k, n_named = names == NULL ? 0 : PyTuple_Size(names);
    int ready = arguments != NULL && (names == NULL || named != NULL);
    for (k = 0; ready && k < n_named; k++) ready = PyDict_SetItem(named, PyTuple_GetItem(names, k), given[n + k]) == 0;
    if (ready) answer = PyObject_Call(query->function, arguments, named);
    Py_XDECREF(arguments);
    Py_XDECREF(named);
    return answer;
}

/* A result that is opened when its fields are asked for (`_single` of collide/results.py and contact_rows.py). Takes over the
   reference to what it is opened from. */
static PyObject *result_of(const struct query *query, PyObject *single)
{
    PyObject *result = single == NULL ? NULL : PyType_GenericAlloc((PyTypeObject *)query->result, 0);
    if (result != NULL && PyObject_SetAttr(result, words[SINGLE], single) < 0) Py_CLEAR(result);
    Py_XDECREF(single);
    return result;
}

static PyObject *ask_collide(PyObject *, PyObject *const *, Py_ssize_t, PyObject *);
static PyObject *ask_distance(PyObject *, PyObject *const *, Py_ssize_t, PyObject *);
static PyObject *ask_contacts(PyObject *, PyObject *const *, Py_ssize_t, PyObject *);

#define ASKS(name) {#name, (PyCFunction)(void (*)(void))ask_##name, METH_FASTCALL | METH_KEYWORDS, NULL}
static struct query queries[] = {
    {.method = ASKS(collide), .length = SECURITY_MARGIN, .option = WORDS, .none = {AXES, ALGORITHM}},
    {.method = ASKS(distance), .length = MAX_DISTANCE, .option = SIGNED, .none = {WORDS, WORDS}},
    {.method = ASKS(contacts), .length = MARGIN, .option = MAX_CONTACTS, .none = {WORDS, WORDS}},
};

static PyObject *ask_collide(PyObject *self, PyObject *const *given, Py_ssize_t n, PyObject *names)
{
    const struct query *query = &queries[0];
    struct options read;
    PyObject *single, *answer;
    int found;
    if (n == 4 && read_options(query, names, given + n, &read)) {
        int is_touch = read.length == query->usual_length || PyFloat_AsDouble(read.length) == 0.0;
        enum word question = !is_touch ? WITHIN : are_batch(given[2], given[3]) ? COLLIDE_POSES : COLLIDE;
        PyObject *arguments[3] = {given[2], given[3], read.length};
        if ((found = single_of(query, given, question, &single)) < 0) return NULL;
        if (found) {
            if ((answer = answer_of_single(single, arguments, is_touch ? 2 : 3)) != Py_None) return answer;
            Py_DECREF(answer);
        }
    }
    return long_way(query, given, n, names);
}

/* A result of many poses, from (rows, poses of A, poses of B) as the pair's function gives them. Takes over the reference to these. */
static PyObject *result_of_poses(const struct query *query, PyObject *A, PyObject *B, PyObject *answer)
{
    PyObject *rows, *X_WA, *X_WB, *question, *result = NULL;
    if (!PyArg_ParseTuple(answer, "OOO:distance_poses", &rows, &X_WA, &X_WB)) question = NULL;
    else question = PyTuple_Pack(4, A, B, X_WA, X_WB);
    if (question != NULL) result = PyObject_CallFunctionObjArgs(query->result, rows, Py_False, question, query->certify, NULL);
    Py_XDECREF(question);
    Py_DECREF(answer);
    return result;
}

/* The memory of a single distance: its row, and the poses as they were. */
struct single_pair { collide_pair row; double X_WA[16], X_WB[16]; };

static PyObject *ask_distance(PyObject *self, PyObject *const *given, Py_ssize_t n, PyObject *names)
{
    const struct query *query = &queries[1];
    struct options read;
    PyObject *single, *memory, *answer;
    void *X_WA, *X_WB;
    int found;
    if (n == 4 && (X_WA = matrix_of(given[2])) != NULL && (X_WB = matrix_of(given[3])) != NULL &&
        read_options(query, names, given + n, &read) && (read.option == Py_True || read.option == Py_False)) {
        if ((found = single_of(query, given, DISTANCE, &single)) < 0) return NULL;
        if (found && single != Py_None) {
            memory = PyByteArray_FromStringAndSize(NULL, sizeof(struct single_pair));
            if (memory == NULL) answer = NULL;
            else {
                PyObject *arguments[5] = {given[2], given[3], memory, read.option, read.length};
                struct single_pair *pair = (struct single_pair *)(void *)PyByteArray_AsString(memory);
                memset(&pair->row, 0, sizeof pair->row);
                memcpy(pair->X_WA, X_WA, sizeof pair->X_WA);
                memcpy(pair->X_WB, X_WB, sizeof pair->X_WB);
                answer = answer_of_single(Py_NewRef(single), arguments, 5);
            }
            Py_DECREF(single);
            if (answer == Py_True || answer == Py_False) {
                Py_DECREF(answer);
                answer = result_of(query, PyTuple_Pack(4, given[0], given[1], memory, query->certify));
                Py_DECREF(memory);
                return answer;
            }
            Py_XDECREF(memory);
            if (answer == NULL) return NULL;
            Py_DECREF(answer);
        } else Py_XDECREF(single);
    } else if (n == 4 && are_batch(given[2], given[3]) && read_options(query, names, given + n, &read) &&
               (read.option == Py_True || read.option == Py_False)) {
        PyObject *arguments[4] = {given[2], given[3], read.option, read.length};
        if ((found = single_of(query, given, DISTANCE_POSES, &single)) < 0) return NULL;
        if (found) {
            if ((answer = answer_of_single(single, arguments, 4)) == NULL) return NULL;
            if (answer != Py_None) return result_of_poses(query, given[0], given[1], answer);
            Py_DECREF(answer);
        }
    }
    return long_way(query, given, n, names);
}

/* More contacts than a patch can have, and a number that kernels take. */
#define ALL_CONTACTS 0x7fffffff

static PyObject *ask_contacts(PyObject *self, PyObject *const *given, Py_ssize_t n, PyObject *names)
{
    const struct query *query = &queries[2];
    struct options read;
    PyObject *single, *answer;
    int found;
    if (n == 4 && read_options(query, names, given + n, &read) && PyLong_CheckExact(read.option)) {
        long long most = PyLong_AsLongLong(read.option);
        PyObject *arguments[4] = {given[2], given[3], read.option, read.length};
        if (most == -1 && PyErr_Occurred() != NULL) PyErr_Clear();
        if (most < 1 || most > ALL_CONTACTS) return long_way(query, given, n, names);
        if ((found = single_of(query, given, CONTACTS, &single)) < 0) return NULL;
        if (found) {
            if ((answer = answer_of_single(single, arguments, 4)) == NULL) return NULL;
            if (answer != Py_None) return result_of(query, answer);
            Py_DECREF(answer);
        }
    }
    return long_way(query, given, n, names);
}

/* nearest_of_pair(A, B, X_WA, X_WB, signed): the fields of the row of `distance`; None where that has to be asked. */
static PyObject *nearest_of_pair(PyObject *module, PyObject *const *given, Py_ssize_t n)
{
    const struct query *query = &queries[1];
    PyObject *single, *memory, *answer, *arguments[5];
    int found;
    if (n != 5) return wrong_count("nearest_of_pair", 5, n);
    if (query->prepare == NULL || matrix_of(given[2]) == NULL || matrix_of(given[3]) == NULL) Py_RETURN_NONE;
    if ((found = single_of(query, given, DISTANCE, &single)) < 0) return NULL;
    if (!found) Py_RETURN_NONE;
    if ((memory = PyByteArray_FromStringAndSize(NULL, sizeof(collide_pair))) == NULL) {
        Py_DECREF(single);
        return NULL;
    }
    memset(PyByteArray_AsString(memory), 0, sizeof(collide_pair));
    arguments[0] = given[2], arguments[1] = given[3], arguments[2] = memory, arguments[3] = given[4];
    arguments[4] = query->usual_length;
    answer = answer_of_single(single, arguments, 5);
    if (answer != NULL && answer != Py_None) {
        Py_DECREF(answer);
        answer = row_fields(module, memory);
    }
    Py_DECREF(memory);
    return answer;
}

static int keep(PyObject **place, PyObject *object)
{
    Py_XINCREF(object);
    Py_XDECREF(*place);
    *place = object;
    return 1;
}

static int spell_words(void)
{
    int k;
    for (k = 0; k < WORDS; k++)
        if (words[k] == NULL && (words[k] = PyUnicode_InternFromString(spelled[k])) == NULL) return 0;
    return one != NULL || (one = PyLong_FromLong(1)) != NULL;
}

/* query(function, doc, (least, most), (usual length, usual option), prepare, result, certify): the function of the same name as one of C's. The
   doc begins with a line that `inspect.signature` reads. */
static PyObject *query_of(PyObject *module, PyObject *arguments)
{
    PyObject *function, *name, *module_name, *usual_length, *usual_option, *prepare, *result, *certify, *made = NULL;
    const char *doc;
    char *kept;
    double least, most;
    size_t k;
    if (!PyArg_ParseTuple(arguments, "Os(dd)(OO)OOO:query", &function, &doc, &least, &most, &usual_length, &usual_option, &prepare,
                          &result, &certify))
        return NULL;
    if (!spell_words()) return NULL;
    name = PyObject_GetAttrString(function, "__name__");
    module_name = PyObject_GetAttrString(function, "__module__");
    for (k = 0; name != NULL && module_name != NULL && k < sizeof queries / sizeof *queries; k++) {
        struct query *query = &queries[k];
        if (PyUnicode_CompareWithASCIIString(name, query->method.ml_name) != 0) continue;
        if ((kept = PyMem_Malloc(strlen(doc) + 1)) == NULL) {
            PyErr_NoMemory();
            break;
        }
        strcpy(kept, doc);
        PyMem_Free((void *)query->method.ml_doc); /* of the same module, loaded once more */
        query->method.ml_doc = kept;
        query->least = least;
        query->most = most;
        keep(&query->function, function);
        keep(&query->prepare, prepare);
        keep(&query->result, result);
        keep(&query->certify, certify);
        keep(&query->usual_length, usual_length);
        keep(&query->usual_option, usual_option);
        made = PyCFunction_NewEx(&query->method, NULL, module_name); /* without a self it pickles by its name */
        break;
    }
    if (made == NULL && PyErr_Occurred() == NULL) PyErr_SetString(PyExc_ValueError, "query: collide, distance or contacts");
    Py_XDECREF(name);
    Py_XDECREF(module_name);
    return made;
}

/* --- functions of Python that are builtins ------------------------------------------------------------------------- */

/* Methods that were made, by name, for as long as the process lives: there are as many as hosts have functions of ours. */
struct made_method {
    PyMethodDef method;
    struct made_method *next;
    char name[64];
};
static struct made_method *made_methods = NULL;
static PyThread_type_lock made_methods_lock = NULL;

static PyObject *call_self(PyObject *self, PyObject *values, PyObject *keywords) { return PyObject_Call(self, values, keywords); }

/* builtin_of(name, function): the same function as one of C's, for hosts whose programs ask whether a function is a builtin. */
static PyObject *builtin_of(PyObject *module, PyObject *arguments)
{
    const char *name;
    PyObject *function;
    struct made_method *made;
    if (!PyArg_ParseTuple(arguments, "sO:builtin_of", &name, &function)) return NULL;
    if (!PyCallable_Check(function) || strlen(name) >= sizeof made->name) {
        PyErr_SetString(PyExc_TypeError, "builtin_of: a name of less than 64 bytes, and what can be called");
        return NULL;
    }
    PyThread_acquire_lock(made_methods_lock, WAIT_LOCK); /* nobody calls Python, nor waits, who holds it */
    for (made = made_methods; made != NULL && strcmp(made->name, name) != 0; made = made->next) {}
    if (made == NULL && (made = PyMem_Calloc(1, sizeof *made)) != NULL) {
        strcpy(made->name, name);
        made->method.ml_name = made->name;
        made->method.ml_meth = (PyCFunction)(void (*)(void))call_self;
        made->method.ml_flags = METH_VARARGS | METH_KEYWORDS;
        made->next = made_methods;
        made_methods = made;
    }
    PyThread_release_lock(made_methods_lock);
    return made == NULL ? PyErr_NoMemory() : PyCFunction_New(&made->method, function);
}

/* --- the module ---------------------------------------------------------------------------------------------------- */

static PyObject *address_of(PyObject *module, PyObject *given)
{
    if (!PyArray_Check(given) || !PyArray_IS_C_CONTIGUOUS((PyArrayObject *)given)) {
        PyErr_SetString(PyExc_ValueError, "kernels read C-contiguous buffers");
        return NULL;
    }
    return PyLong_FromVoidPtr(PyArray_DATA((PyArrayObject *)given));
}

static PyObject *code_of(PyObject *module, PyObject *given)
{
    const char *name = PyUnicode_AsUTF8AndSize(given, NULL);
    size_t k;
    if (name == NULL) return NULL;
    for (k = 0; k < COLLIDE_KERNELS; k++) {
        void *code;
        if (strcmp(kernel_names[k], name) != 0) continue;
        memcpy(&code, (const char *)kernels + k * sizeof code, sizeof code); /* the table is all pointers */
        return PyLong_FromVoidPtr(code);
    }
    PyErr_Format(PyExc_KeyError, "%s is no kernel of this library", name);
    return NULL;
}

/* (address of a function of a library, the library opened and never closed); NULL and an exception where there is none. */
static void *symbol_of(const char *path, const char *name)
{
#if defined(_WIN32)
    wchar_t wide[32768];
    HMODULE library;
    if (MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 32768) == 0) library = NULL;
    else library = LoadLibraryExW(wide, NULL, LOAD_LIBRARY_SEARCH_DLL_LOAD_DIR | LOAD_LIBRARY_SEARCH_SYSTEM32);
    void *found = library == NULL ? NULL : (void *)GetProcAddress(library, name);
    if (found == NULL) PyErr_Format(PyExc_OSError, "%s of %s: error %lu", name, path, GetLastError());
#else
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    void *found = library == NULL ? NULL : dlsym(library, name);
    if (found == NULL) PyErr_Format(PyExc_OSError, "%s", dlerror());
#endif
    return found;
}

/* load(path, level, by_thread): the level chosen. Raises OSError where the library cannot be used, ValueError of a level that is not to be
   had. */
static PyObject *load(PyObject *module, PyObject *arguments)
{
    const char *path, *wanted, *level = NULL, *why = NULL;
    unsigned (*table)(void);
    const struct collide_kernels *(*of_level)(const char *, const char **, const char **);
    const struct collide_kernels *found;
    void *symbol;
    int is_by_thread;
    if (!PyArg_ParseTuple(arguments, "ssp:load", &path, &wanted, &is_by_thread)) return NULL;
    if ((symbol = symbol_of(path, "collide_kernel_table")) == NULL) return NULL;
    memcpy(&table, &symbol, sizeof table);
    if (table() != COLLIDE_TABLE) {
        PyErr_Format(PyExc_OSError, "%s is of another version than this module", path);
        return NULL;
    }
    if ((symbol = symbol_of(path, "collide_kernels_of_level")) == NULL) return NULL;
    memcpy(&of_level, &symbol, sizeof of_level);
    found = of_level(wanted, &level, &why);
    if (found == NULL) {
        PyErr_SetString(PyExc_ValueError, why);
        return NULL;
    }
    kernels = found;
    by_thread = is_by_thread;
    return PyUnicode_FromString(level);
}

static PyMethodDef methods[] = {
    ENTRIES
    {"load", load, METH_VARARGS, NULL},
    {"prepared", prepared, METH_VARARGS, NULL},
    {"query", query_of, METH_VARARGS, NULL},
    {"address_of", address_of, METH_O, NULL},
    {"code_of", code_of, METH_O, NULL},
    {"builtin_of", builtin_of, METH_VARARGS, NULL},
    {"nearest_of_pair", (PyCFunction)(void (*)(void))nearest_of_pair, METH_FASTCALL, NULL},
    {"row_fields", row_fields, METH_O, NULL},
    {NULL, NULL, 0, NULL},
};

/* 0, or −1 with an exception. */
static int begin(PyObject *module)
{
    import_array1(-1);
    if (made_methods_lock == NULL && (made_methods_lock = PyThread_allocate_lock()) == NULL) {
        PyErr_NoMemory();
        return -1;
    }
    return 0;
}

/* The module needs no lock of Python's: what it has of its own is written while it is imported, or under a lock of its own, and
   memory that kernels write is the calling thread's. */
#if defined(Py_TARGET_ABI3T)
PyABIInfo_VAR(abi_of_build);
static PySlot slots[] = {
    PySlot_STATIC_DATA(Py_mod_abi, &abi_of_build),
    PySlot_STATIC_DATA(Py_mod_name, "_glue"),
    PySlot_STATIC_DATA(Py_mod_methods, methods),
    PySlot_FUNC(Py_mod_exec, begin),
    PySlot_DATA(Py_mod_multiple_interpreters, Py_MOD_MULTIPLE_INTERPRETERS_NOT_SUPPORTED),
    PySlot_DATA(Py_mod_gil, Py_MOD_GIL_NOT_USED),
    PySlot_END,
};

PyMODEXPORT_FUNC PyModExport__glue(void) { return slots; }
#else
static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_glue", NULL, -1, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__glue(void)
{
    PyObject *module = PyModule_Create(&definition);
    if (module != NULL && begin(module) < 0) Py_CLEAR(module);
#if defined(Py_GIL_DISABLED)
    if (module != NULL && PyUnstable_Module_SetGIL(module, Py_MOD_GIL_NOT_USED) < 0) Py_CLEAR(module);
#endif
    return module;
}
#endif
