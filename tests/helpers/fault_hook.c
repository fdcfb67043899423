/* Lets reads and writes of chosen files fail, as a failing card or a full disk does. Loaded with LD_PRELOAD.
 *
 * FAULT_READ names a file by the end of its path: reads that touch FAULT_FROM bytes or more of it fail with
 * FAULT_ERRNO. FAULT_FULL names a file: while it exists, writes to paths that contain FAULT_WRITE fail with
 * ENOSPC.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/uio.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int path_of(int file, char *path, size_t size)
{
    char link[64];
    ssize_t length;

    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    length = readlink(link, path, size - 1);
    if (length < 0)
        return 0;
    path[length] = 0;
    return 1;
}

static int read_fails(int file, off_t end)
{
    const char *wanted = getenv("FAULT_READ"), *from = getenv("FAULT_FROM"), *number = getenv("FAULT_ERRNO");
    char path[4096];
    size_t length;

    if (!wanted || !path_of(file, path, sizeof path))
        return 0;
    length = strlen(path);
    if (length < strlen(wanted) || strcmp(path + length - strlen(wanted), wanted) || end <= atol(from))
        return 0;
    errno = atoi(number);
    return 1;
}

ssize_t read(int file, void *data, size_t length)
{
    if (getenv("FAULT_READ") && read_fails(file, lseek(file, 0, SEEK_CUR) + (off_t)length))
        return -1;
    return REAL(read)(file, data, length);
}

ssize_t write(int file, const void *data, size_t length)
{
    const char *full = getenv("FAULT_FULL"), *wanted = getenv("FAULT_WRITE");
    char path[4096];

    if (full && wanted && !access(full, F_OK) && path_of(file, path, sizeof path) && strstr(path, wanted)) {
        errno = ENOSPC;
        return -1;
    }
    return REAL(write)(file, data, length);
}
