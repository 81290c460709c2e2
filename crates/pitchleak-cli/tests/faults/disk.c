/* Between a program and its disk (LD_PRELOAD): counts what it does to regular files and folders, and lets one of these
 * operations go wrong.
 *
 * DISK_FAULT   "fails ERRNO N"   operation N and all later ones fail (a full disk stays full)
 *              "once ERRNO N"    operation N alone fails
 *              "kills N"         the program is killed within operation N, a write half done
 *              "hampers"         every other write is interrupted, and every write is short
 * DISK_COUNT   file to which the number of operations is written at the end
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int count;

static const char *fault(void) {
    const char *text = getenv("DISK_FAULT");
    return text ? text : "";
}

/* Whether the next operation goes wrong; a write of so many bytes is half done before the kill. */
static int strikes(int fd, const void *bytes, size_t length) {
    int at, number = __atomic_fetch_add(&count, 1, __ATOMIC_SEQ_CST);
    if (sscanf(fault(), "kills %d", &at) == 1 && number == at) {
        if (length > 1) REAL(write)(fd, bytes, length / 2);
        raise(SIGKILL);
    }
    int error;
    if ((sscanf(fault(), "fails %d %d", &error, &at) == 2 && number >= at) ||
        (sscanf(fault(), "once %d %d", &error, &at) == 2 && number == at)) {
        errno = error;
        return 1;
    }
    return 0;
}

static int on_disk(int fd) {
    struct stat status;
    return fstat(fd, &status) == 0 && (S_ISREG(status.st_mode) || S_ISDIR(status.st_mode));
}

ssize_t write(int fd, const void *bytes, size_t length) {
    if (!on_disk(fd)) return REAL(write)(fd, bytes, length);
    if (strikes(fd, bytes, length)) return -1;
    if (strcmp(fault(), "hampers") == 0) {
        static int turn;
        if (turn++ % 2 == 0) {
            errno = EINTR;
            return -1;
        }
        length = length > 1000 ? 1000 : length;
    }
    return REAL(write)(fd, bytes, length);
}

int fsync(int fd) { return strikes(fd, "", 0) ? -1 : REAL(fsync)(fd); }

int fdatasync(int fd) { return strikes(fd, "", 0) ? -1 : REAL(fdatasync)(fd); }

int fchmod(int fd, mode_t mode) { return strikes(fd, "", 0) ? -1 : REAL(fchmod)(fd, mode); }

int rename(const char *from, const char *to) { return strikes(-1, "", 0) ? -1 : REAL(rename)(from, to); }

static int opens(int (*real)(const char *, int, ...), const char *path, int flags, mode_t mode) {
    if ((flags & O_CREAT) && strikes(-1, "", 0)) return -1;
    return real(path, flags, mode);
}

#define MODE mode_t mode = 0; if (flags & (O_CREAT | O_TMPFILE)) { va_list rest; va_start(rest, flags); \
    mode = va_arg(rest, mode_t); va_end(rest); }

int open(const char *path, int flags, ...) { MODE return opens(REAL(open), path, flags, mode); }

int open64(const char *path, int flags, ...) { MODE return opens(REAL(open64), path, flags, mode); }

__attribute__((destructor)) static void tell(void) {
    const char *path = getenv("DISK_COUNT");
    int fd = path ? REAL(open)(path, O_WRONLY | O_CREAT | O_TRUNC, 0644) : -1;
    if (fd >= 0) dprintf(fd, "%d", count);
}
