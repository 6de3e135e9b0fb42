/* Preloaded into a process on Linux, x86-64: what it runs sees a processor without the instructions that HELD_TO excludes.
 *
 * Programs ask the processor for its instructions by CPUID. The kernel can make that trap; the trap is answered here, with
 * the bits of wider instructions cleared. HELD_TO is sse2, avx2 or avx512; child processes inherit it. */
#define _GNU_SOURCE
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

enum { SET_CPUID = 0x1012 }; /* of arch_prctl */
static enum { SSE2, AVX2, AVX512 } widest;

static void trap_cpuid(int trapped) { syscall(SYS_arch_prctl, SET_CPUID, trapped ? 0L : 1L); }

static void clear(uint32_t leaf, uint32_t part, uint32_t r[4]) {
    /* r: eax, ebx, ecx, edx */
    if (widest == SSE2) {
        if (leaf == 1)
            r[2] &= ~(1u << 12 | 1u << 28 | 1u << 29); /* FMA, AVX, F16C; NumPy itself needs what lies between SSE2 and AVX */
        if (leaf == 7 && part == 0)
            r[1] &= ~(1u << 3 | 1u << 5 | 1u << 8), r[2] &= ~(1u << 8 | 1u << 9 | 1u << 10); /* BMI, AVX2, GFNI, VAES */
        if (leaf == 7 && part == 1)
            r[0] = r[1] = r[2] = r[3] = 0;
        if (leaf == 0x80000001)
            r[2] &= ~(1u << 5 | 1u << 6 | 1u << 11 | 1u << 16); /* LZCNT, SSE4a, XOP, FMA4 */
    }
    if (widest != AVX512 && leaf == 7 && part == 0) {
        r[1] &= ~(1u << 16 | 1u << 17 | 1u << 21 | 1u << 26 | 1u << 27 | 1u << 28 | 1u << 30 | 1u << 31); /* AVX-512 */
        r[2] &= ~(1u << 1 | 1u << 6 | 1u << 11 | 1u << 12 | 1u << 14);
        r[3] &= ~(1u << 2 | 1u << 3 | 1u << 8 | 1u << 22 | 1u << 23 | 1u << 24 | 1u << 25);
    }
    if (widest != AVX512 && leaf == 7 && part == 1)
        r[0] &= ~(1u << 5);
}

static void answer(int number, siginfo_t *about, void *context) {
    greg_t *g = ((ucontext_t *)context)->uc_mcontext.gregs;
    const unsigned char *at = (const unsigned char *)g[REG_RIP];
    if (at == NULL || at[0] != 0x0f || at[1] != 0xa2) { /* another fault: die of it */
        signal(number, SIG_DFL);
        return;
    }
    uint32_t leaf = (uint32_t)g[REG_RAX], part = (uint32_t)g[REG_RCX], r[4];
    trap_cpuid(0);
    __asm__ volatile("cpuid" : "=a"(r[0]), "=b"(r[1]), "=c"(r[2]), "=d"(r[3]) : "a"(leaf), "c"(part));
    trap_cpuid(1);
    clear(leaf, part, r);
    g[REG_RAX] = r[0], g[REG_RBX] = r[1], g[REG_RCX] = r[2], g[REG_RDX] = r[3];
    g[REG_RIP] += 2;
    (void)about;
}

__attribute__((constructor)) static void hold(void) {
    const char *to = getenv("HELD_TO");
    if (to == NULL)
        return;
    widest = strcmp(to, "sse2") == 0 ? SSE2 : strcmp(to, "avx2") == 0 ? AVX2 : AVX512;
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_sigaction = answer;
    action.sa_flags = SA_SIGINFO | SA_NODEFER;
    if (sigaction(SIGSEGV, &action, NULL) != 0 || syscall(SYS_arch_prctl, SET_CPUID, 0L) != 0) {
        fprintf(stderr, "this kernel or processor cannot trap CPUID\n");
        _exit(3);
    }
}
