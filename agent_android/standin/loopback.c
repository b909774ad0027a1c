/* Preloaded into adbd, which listens on every address without authentication: its sockets get loopback instead. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>

typedef int (*binder)(int, const struct sockaddr *, socklen_t);

static int bind_v4(binder real, int fd, const struct sockaddr *address) {
    struct sockaddr_in loopback;
    memcpy(&loopback, address, sizeof loopback);
    loopback.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return real(fd, (struct sockaddr *)&loopback, sizeof loopback);
}

/* A socket of both families listens on 127.0.0.1, one of IPv6 alone on ::1. */
static int bind_v6(binder real, int fd, const struct sockaddr *address) {
    struct sockaddr_in6 loopback;
    int only = 0;
    socklen_t size = sizeof only;
    memcpy(&loopback, address, sizeof loopback);
    getsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &only, &size);
    inet_pton(AF_INET6, only ? "::1" : "::ffff:127.0.0.1", &loopback.sin6_addr);
    return real(fd, (struct sockaddr *)&loopback, sizeof loopback);
}

int bind(int fd, const struct sockaddr *address, socklen_t size) {
    binder real = (binder)dlsym(RTLD_NEXT, "bind");
    if (address->sa_family == AF_INET && size >= sizeof(struct sockaddr_in)) return bind_v4(real, fd, address);
    if (address->sa_family == AF_INET6 && size >= sizeof(struct sockaddr_in6)) return bind_v6(real, fd, address);
    /* adbd's abstract @jdwp-control is one for the machine; an unnamed one lets two phones be. */
    if (address->sa_family == AF_UNIX) return real(fd, address, sizeof(sa_family_t));
    /* vsock among others reaches beyond this machine. */
    errno = EADDRNOTAVAIL;
    return -1;
}
