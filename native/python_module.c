/* collide.kernels._glue: the kernels of libcollide as Python functions, of CPython's limited interface.

   The library is opened by its path, after Python has looked at its size and checksum. Numpy's arrays are read through
   numpy's own C interface. */
#define Py_LIMITED_API 0x030A0000
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#define NPY_TARGET_VERSION NPY_1_22_API_VERSION
#include <numpy/arrayobject.h>

#include <stdint.h>
#include <string.h>
#if defined(_WIN32)
#include <windows.h>
#else
#include <dlfcn.h>
#endif

#include "kernels.h"
#include "kernels_of_level.h"

static const struct collide_kernels *kernels = NULL;
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

#define SINGLE_ROW(name)                                                                                                 \
    static PyObject *single_##name(PyObject *self, PyObject *const *given, Py_ssize_t n)                                 \
    {                                                                                                                    \
        void *A, *B, *out;                                                                                               \
        double limit;                                                                                                    \
        uint8_t flag;                                                                                                    \
        if (n != 5) return wrong_count(#name, 5, n);                                                                     \
        A = matrix_of(given[0]);                                                                                         \
        B = matrix_of(given[1]);                                                                                         \
        if (A == NULL || B == NULL) Py_RETURN_NONE;                                                                      \
        if (!PyArray_Check(given[2]) || !PyArray_ISCARRAY((PyArrayObject *)given[2])) {                                  \
            PyErr_SetString(PyExc_TypeError, #name ": the answer goes into a contiguous array that can be written");     \
            return NULL;                                                                                                 \
        }                                                                                                                \
        out = PyArray_DATA((PyArrayObject *)given[2]);                                                                   \
        if (truth_of(given[3], &flag) < 0 || double_of(given[4], &limit) < 0) return NULL;                               \
        return answer_of(                                                                                                \
            kernels->name(HEADER(self), (int64_t)(intptr_t)A, (int64_t)(intptr_t)B, (int64_t)(intptr_t)out, flag, limit)); \
    }

SINGLES

#define SINGLE_METHOD(name) {#name, (PyCFunction)(void (*)(void))single_##name, METH_FASTCALL, NULL},
static PyMethodDef single_methods[] = {SINGLE_METHODS{NULL, NULL, 0, NULL}};

/* prepared(name, header): the function of a single call with its header, held as long as the function lives. */
static PyObject *prepared(PyObject *module, PyObject *arguments)
{
    const char *name;
    PyObject *header;
    PyMethodDef *method;
    if (!PyArg_ParseTuple(arguments, "sO:prepared", &name, &header)) return NULL;
    if (!PyArray_Check(header) || PyArray_TYPE((PyArrayObject *)header) != NPY_INT64 || !PyArray_ISCARRAY((PyArrayObject *)header)) {
        PyErr_SetString(PyExc_TypeError, "prepared: the header must be a contiguous array of int64");
        return NULL;
    }
    for (method = single_methods; method->ml_name != NULL; method++)
        if (strcmp(method->ml_name, name) == 0) return PyCFunction_New(method, header);
    PyErr_Format(PyExc_ValueError, "prepared: %s is no kernel of single calls", name);
    return NULL;
}

/* --- functions of Python that are builtins ------------------------------------------------------------------------- */

/* Methods that were made, by name, for as long as the process lives: there are as many as hosts have functions of ours. */
struct made_method {
    PyMethodDef method;
    struct made_method *next;
    char name[64];
};
static struct made_method *made_methods = NULL;

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
    for (made = made_methods; made != NULL && strcmp(made->name, name) != 0; made = made->next) {}
    if (made == NULL) {
        if ((made = PyMem_Calloc(1, sizeof *made)) == NULL) return PyErr_NoMemory();
        strcpy(made->name, name);
        made->method.ml_name = made->name;
        made->method.ml_meth = (PyCFunction)(void (*)(void))call_self;
        made->method.ml_flags = METH_VARARGS | METH_KEYWORDS;
        made->next = made_methods;
        made_methods = made;
    }
    return PyCFunction_New(&made->method, function);
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

/* load(path, level): the level chosen. Raises OSError where the library cannot be used, ValueError of a level that is not to be
   had. */
static PyObject *load(PyObject *module, PyObject *arguments)
{
    const char *path, *wanted, *level = NULL, *why = NULL;
    unsigned (*table)(void);
    const struct collide_kernels *(*of_level)(const char *, const char **, const char **);
    const struct collide_kernels *found;
    void *symbol;
    if (!PyArg_ParseTuple(arguments, "ss:load", &path, &wanted)) return NULL;
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
    return PyUnicode_FromString(level);
}

static PyMethodDef methods[] = {
    ENTRIES
    {"load", load, METH_VARARGS, NULL},
    {"prepared", prepared, METH_VARARGS, NULL},
    {"address_of", address_of, METH_O, NULL},
    {"code_of", code_of, METH_O, NULL},
    {"builtin_of", builtin_of, METH_VARARGS, NULL},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_glue", NULL, -1, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__glue(void)
{
    import_array();
    return PyModule_Create(&definition);
}
