/* Send a file of slcan lines over TCP at an even pace: flood FILE LINES_PER_SECOND. Prints the port it listens on, and
 * at the end how many lines it sent, in what time, and by how much it fell behind its pace at worst. */
#define _POSIX_C_SOURCE 200809L
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int fail(const char *what)
{
    perror(what);
    return 2;
}

static int wait_for_peer(void)
{
    struct sockaddr_in address = {.sin_family = AF_INET};
    socklen_t length = sizeof address;
    int server = socket(AF_INET, SOCK_STREAM, 0);

    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (server < 0 || bind(server, (struct sockaddr *)&address, length) != 0 || listen(server, 1) != 0 ||
        getsockname(server, (struct sockaddr *)&address, &length) != 0) {
        return -1;
    }
    printf("%d\n", ntohs(address.sin_port));
    fflush(stdout);
    return accept(server, NULL, NULL);
}

/* Wait for the command that opens the channel: a listener throws away what came before it. */
static int wait_for_opening(int peer)
{
    char letter = 0;
    while (letter != 'O') {
        if (read(peer, &letter, 1) != 1) {
            return -1;
        }
    }
    return 0;
}

static int send_all(int peer, const char *text, size_t length)
{
    while (length > 0) {
        const ssize_t sent = write(peer, text, length);
        if (sent <= 0) {
            return -1;
        }
        text += sent;
        length -= (size_t)sent;
    }
    return 0;
}

/* Send what is due every millisecond; *behind becomes the longest time by which a line left late. */
static long send_paced(int peer, const char *text, size_t size, double rate, double *behind)
{
    const char *at = text, *end = text + size;
    const double began = now_s();
    long sent = 0;

    while (at < end) {
        const long due = (long)((now_s() - began) * rate);
        const char *from = at;
        while (sent < due && at < end) {
            at = (const char *)memchr(at, '\r', (size_t)(end - at)) + 1;
            sent++;
        }
        if (at > from && send_all(peer, from, (size_t)(at - from)) != 0) {
            return -1;
        }
        const double late = now_s() - began - (double)sent / rate;
        *behind = late > *behind ? late : *behind;
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
    return sent;
}

int main(int count, char **words)
{
    struct stat facts;
    double behind = 0.0;
    const int file = count == 3 ? open(words[1], O_RDONLY) : -1;
    if (file < 0 || fstat(file, &facts) != 0) {
        return fail("flood FILE LINES_PER_SECOND");
    }
    const char *text = mmap(NULL, (size_t)facts.st_size, PROT_READ, MAP_PRIVATE, file, 0);
    const int peer = text == MAP_FAILED ? -1 : wait_for_peer();
    if (peer < 0 || wait_for_opening(peer) != 0) {
        return fail("flood");
    }
    const double began = now_s();
    const long sent = send_paced(peer, text, (size_t)facts.st_size, strtod(words[2], NULL), &behind);
    printf("%ld %.3f %.3f\n", sent, now_s() - began, behind);
    char unread[256]; /* closing with something unread would reset the connection and cost what is under way */
    shutdown(peer, SHUT_WR);
    while (read(peer, unread, sizeof unread) > 0) {
    }
    close(peer);
    return sent < 0 ? 1 : 0;
}
