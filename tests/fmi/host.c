/* A host: LIBRARY TOKEN REFERENCE... simulates 0.5 s in 50 steps and prints the variables at the end. */
#include <stdio.h>
#include <stdlib.h>
#ifdef _WIN32
#include <windows.h>
#define OPEN(name) LoadLibraryA(name)
#define LOOK_UP GetProcAddress
#else
#include <dlfcn.h>
#define HMODULE void *
#define OPEN(name) dlopen(name, RTLD_NOW)
#define LOOK_UP dlsym
#endif
#include "fmi3Functions.h"

static void told(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String text) {
    (void)environment;
    printf("%d %s %s\n", status, category, text);
}

#define FIND(name)                                                      \
    name##TYPE *a_##name = (name##TYPE *)(void *)LOOK_UP(library, #name); \
    if (!a_##name) {                                                    \
        printf("there is no %s\n", #name);                              \
        return 2;                                                       \
    }

int main(int count, char **given) {
    HMODULE library = OPEN(given[1]);
    fmi3Boolean event, end, early;
    double last;
    if (!library) {
        printf("the library cannot be loaded\n");
        return 1;
    }
    FIND(fmi3InstantiateCoSimulation)
    FIND(fmi3EnterInitializationMode)
    FIND(fmi3ExitInitializationMode)
    FIND(fmi3DoStep)
    FIND(fmi3GetFloat64)
    FIND(fmi3Terminate)
    FIND(fmi3FreeInstance)
    fmi3Instance one = a_fmi3InstantiateCoSimulation("one", given[2], NULL, 0, 0, 0, 0, NULL, 0, NULL, told, NULL);
    if (!one || a_fmi3EnterInitializationMode(one, 1, 1e-10, 0.0, 1, 0.5) || a_fmi3ExitInitializationMode(one)) return 3;
    for (int i = 0; i < 50; i++)
        if (a_fmi3DoStep(one, 0.01 * i, 0.01, 1, &event, &end, &early, &last)) return 4;
    for (int k = 3; k < count; k++) {
        fmi3ValueReference reference = (fmi3ValueReference)atoi(given[k]);
        double value;
        if (a_fmi3GetFloat64(one, &reference, 1, &value, 1)) return 5;
        printf("%.17g\n", value);
    }
    a_fmi3Terminate(one);
    a_fmi3FreeInstance(one);
    return 0;
}
