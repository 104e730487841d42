/* First process of the emulated guest, alone in its initial RAM disk: loads the kernel's modules, makes the host's files
 * the root, read-only but for one folder, and becomes the host's shell with the guest's script.
 *
 * The kernel's command line holds: guest_init=SCRIPT guest_out=FOLDER
 */
#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/syscall.h>
#include <unistd.h>

#define SHARE   "trans=virtio,version=9p2000.L,msize=1048576"
#define LONGEST 1024

static void check(int holds, const char *what)
{
    if (!holds) {
        (void)printf("first process: %s: %s\n", what, strerror(errno));
        (void)fflush(stdout);
        (void)reboot(RB_POWER_OFF);
        exit(1);
    }
}

/* Load every module, in the order of their names. */
static void load_modules(void)
{
    glob_t found;
    size_t i;
    check(glob("/modules/*", 0, NULL, &found) == 0, "no modules");
    for (i = 0; i < found.gl_pathc; i++) {
        const int file = open(found.gl_pathv[i], O_RDONLY);
        check(syscall(SYS_finit_module, file, "", 0) == 0 || errno == EEXIST, found.gl_pathv[i]);
        (void)close(file);
    }
    globfree(&found);
}

/* Copy the value of a word of the kernel's command line. */
static void read_word(const char *name, char *value)
{
    static char line[4 * LONGEST];
    const char *at;
    const int file = open("/proc/cmdline", O_RDONLY);
    check(read(file, line, sizeof line - 1u) > 0, "/proc/cmdline");
    (void)close(file);
    at = strstr(line, name);
    check(at != NULL && sscanf(at + strlen(name), "%1000s", value) == 1, name);
}

int main(void)
{
    static char out[LONGEST], script[LONGEST], target[LONGEST + 8];
    check(mount("proc", "/proc", "proc", 0, "") == 0, "/proc");
    load_modules();
    read_word(" guest_out=", out);
    read_word(" guest_init=", script);
    check(mount("host", "/host", "9p", MS_RDONLY, SHARE ",cache=loose") == 0, "the host's files");
    (void)snprintf(target, sizeof target, "/host%s", out);
    check(mount("out", target, "9p", 0, SHARE) == 0, "the folder to write to");
    (void)umount("/proc");
    check(chdir("/host") == 0 && mount(".", "/", NULL, MS_MOVE, NULL) == 0 && chroot(".") == 0, "the new root");
    check(chdir("/") == 0, "/");
    (void)execl("/bin/sh", "sh", script, (char *)NULL);
    check(0, "/bin/sh");
    return 1;
}
