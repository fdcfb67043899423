/* Notes every host name that a process looks up and every outside address that it sends to.
 *
 * Loaded with LD_PRELOAD. Each note is a line in the file that NAME_HOOK_LOG names: the process id, the
 * function, and the name or address. If NAME_HOOK_PAST names a file that exists, the real-time clock stands
 * ten years before 1970.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define PAST_SECONDS 2100000000L

static void note(const char *function, const char *name)
{
    const char *path = getenv("NAME_HOOK_LOG");
    char line[512];
    int file, length;

    if (!path || !name)
        return;
    file = open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
    if (file < 0)
        return;
    length = snprintf(line, sizeof line, "%d %s %s\n", (int)getpid(), function, name);
    if (write(file, line, (size_t)length) < 0)
        _exit(97);
    close(file);
}

static void note_address(const char *function, const struct sockaddr *address)
{
    char text[INET6_ADDRSTRLEN] = "";

    if (!address)
        return;
    if (address->sa_family == AF_INET)
        inet_ntop(AF_INET, &((const struct sockaddr_in *)address)->sin_addr, text, sizeof text);
    else if (address->sa_family == AF_INET6)
        inet_ntop(AF_INET6, &((const struct sockaddr_in6 *)address)->sin6_addr, text, sizeof text);
    if (*text)
        note(function, text);
}

int getaddrinfo(const char *node, const char *service, const struct addrinfo *hints, struct addrinfo **found)
{
    note("getaddrinfo", node);
    return REAL(getaddrinfo)(node, service, hints, found);
}

struct hostent *gethostbyname(const char *name)
{
    note("gethostbyname", name);
    return REAL(gethostbyname)(name);
}

struct hostent *gethostbyname2(const char *name, int family)
{
    note("gethostbyname2", name);
    return REAL(gethostbyname2)(name, family);
}

int gethostbyname_r(const char *name, struct hostent *entry, char *buffer, size_t size, struct hostent **found,
                    int *error)
{
    note("gethostbyname_r", name);
    return REAL(gethostbyname_r)(name, entry, buffer, size, found, error);
}

int connect(int socket, const struct sockaddr *address, socklen_t size)
{
    note_address("connect", address);
    return REAL(connect)(socket, address, size);
}

ssize_t sendto(int socket, const void *data, size_t length, int flags, const struct sockaddr *address,
               socklen_t size)
{
    note_address("sendto", address);
    return REAL(sendto)(socket, data, length, flags, address, size);
}

ssize_t sendmsg(int socket, const struct msghdr *message, int flags)
{
    note_address("sendmsg", message->msg_name);
    return REAL(sendmsg)(socket, message, flags);
}

static int is_past(void)
{
    const char *past = getenv("NAME_HOOK_PAST");

    return past && !access(past, F_OK);
}

int gettimeofday(struct timeval *restrict now, void *restrict zone)
{
    int code = REAL(gettimeofday)(now, zone);

    if (!code && is_past())
        now->tv_sec -= PAST_SECONDS;
    return code;
}

time_t time(time_t *now)
{
    struct timespec current;

    clock_gettime(CLOCK_REALTIME, &current);
    if (now)
        *now = current.tv_sec;
    return current.tv_sec;
}

int clock_gettime(clockid_t clock, struct timespec *now)
{
    static int (*real)(clockid_t, struct timespec *);
    int code;

    if (!real)
        real = REAL(clock_gettime);
    code = real(clock, now);
    if (!code && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) && is_past())
        now->tv_sec -= PAST_SECONDS;
    return code;
}
