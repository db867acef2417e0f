"""The loop in which CPU threads carry out a program of kernels together, without a line of Python in between.

A program is a row of *operations*; an operation is a kernel for many elements, cut into *chunks*. All threads share one
*cursor*: which operation is under way and which of its chunks is to be taken next. Whoever finishes the last chunk moves the
cursor on. So no thread ever waits for another one to arrive, only for chunks that are being worked on: a thread that the
system has put aside holds up nobody, unless it was put aside in the middle of a chunk.

The structures are those of :mod:`.threads`, field for field.
"""

from __future__ import annotations

import warp as wp

__all__ = ["BYTES_OF_A_CONDITION", "LARGEST_ARGUMENTS", "MOST_THREADS", "carry_out", "join_in", "read_clock"]

wp.set_module_options({"enable_backward": False})

# Every chunk has its kernel's arguments copied, so that its first element can be written into them [bytes].
LARGEST_ARGUMENTS = 4096
# Room for a lock or a condition variable of any system [bytes], and threads at most.
BYTES_OF_A_CONDITION = 128
MOST_THREADS = 64
# How long a thread that waits stays awake, about 0.4 milliseconds: in ticks of the clock of x86 processors, 2 to 5 GHz, and as a share
# of a second for others. Waking a thread costs whoever wakes it several microseconds, on virtual machines most of all, so that none
# should sleep between the operations of a step. It does not give way to others while it is awake: on a busy machine that costs it a
# whole turn of theirs, and all threads wait for it, while one that slept is let in again soon.
TICKS_AWAKE = 1_000_000
AWAKE_PER_SECOND = 2500
# How long a program that is repeated keeps Python waiting, about 0.1 seconds: Ctrl-C, for one, is heard only there.
TICKS_REPEATING = 250 * TICKS_AWAKE
REPEATING_PER_SECOND = 10

_STRUCTURES = f"""
    struct Operation
    {{
        void (*kernel)(void* bounds, void* arguments);
        const long long* arguments;
        long long arguments_size, first, count, chunks, per_thread;
        long long busy, wall;
    }};
    // Warp takes the name int before a parenthesis for a conversion.
    struct Shared
    {{
        // Sequence number of the operation under way (high half) and its next chunk (low half); the whole program's end has no
        // chunk, which reads as the largest number.
        unsigned long long cursor; char pad_0[120];
        // The cursor's high half once more, for threads that wait: they are not disturbed where others take chunks.
        unsigned long long sequence; char pad_1[120];
        long long done; char pad_2[120];
        // A bit for every thread that sleeps.
        unsigned long long asleep; char pad_3[120];
        Operation* operations;
        long long base, operation_count, stop, timed, started;
        void* lock;
        // Conditions, one for every thread.
        char* wakes;
        signed (*take_lock)(void*);
        signed (*give_lock)(void*);
        signed (*sleep)(void* condition, void* lock, unsigned forever, unsigned shared);
        signed (*wake)(void*);
    }};
    // The launch bounds of a kernel with one dimension, as Warp lays them out.
    struct Bounds {{ unsigned shape; unsigned long long size, threads_per_element; }};
    #define PEEK(x) __atomic_load_n(&(x), __ATOMIC_ACQUIRE)

    auto clock = []() -> long long
    {{
    #if defined(__x86_64__) || defined(_M_X64)
        return (long long)__builtin_ia32_rdtsc();
    #elif defined(__aarch64__)
        long long now;
        __asm__ volatile("mrs %0, cntvct_el0" : "=r"(now));
        return now;
    #else
    #error "no clock is known for this processor"
    #endif
    }};
    auto relax = []()
    {{
    #if defined(__x86_64__) || defined(_M_X64)
        __builtin_ia32_pause();
    #elif defined(__aarch64__)
        __asm__ volatile("yield");
    #endif
    }};
    // The threads that may take one of so many chunks, as bits. Where there are few, it is always the same ones: they have the data
    // at hand, and the others can sleep. The first thread leads the program, so that it is never left alone with chunks of others.
    auto called = [](unsigned chunks) -> unsigned long long {{ return chunks < 64 ? (1ull << chunks) - 1 : ~0ull; }};
    // Wakes two threads of those that sleep; they wake others in turn. A sleeper looks at the sequence after it has set its bit, and
    // with the lock held: whoever publishes something new either sees the bit, or is seen.
    auto wake = [](Shared* s, unsigned long long threads)
    {{
        for (int k = 0; k < 2; ++k)
        {{
            const unsigned long long asleep = __atomic_load_n(&s->asleep, __ATOMIC_SEQ_CST) & threads;
            if (asleep == 0) return;
            const int thread = __builtin_ctzll(asleep);
            const unsigned long long bit = 1ull << thread;
            if ((__atomic_fetch_and(&s->asleep, ~bit, __ATOMIC_SEQ_CST) & bit) == 0) continue;
            s->take_lock(s->lock);
            s->give_lock(s->lock);
            s->wake(s->wakes + {BYTES_OF_A_CONDITION} * thread);
        }}
    }};
"""

_WORK = f"""
    auto work = [&](Shared* s, int thread, bool leads)
    {{
    #if defined(__aarch64__)
        long long awake;
        __asm__ volatile("mrs %0, cntfrq_el0" : "=r"(awake));
        awake /= {AWAKE_PER_SECOND};
    #else
        const long long awake = {TICKS_AWAKE};
    #endif
        // When it last had something to do.
        long long since = clock();
        bool woken = false;
        for (;;)
        {{
            const unsigned long long published = __atomic_load_n(&s->sequence, __ATOMIC_SEQ_CST);
            unsigned long long seen = __atomic_load_n(&s->cursor, __ATOMIC_SEQ_CST);
            const unsigned sequence = (unsigned)(seen >> 32), chunk = (unsigned)seen;
            const unsigned at = sequence - (unsigned)PEEK(s->base);
            const unsigned operation_count = (unsigned)PEEK(s->operation_count);
            Operation* operations = PEEK(s->operations);
            // Some of this may belong to the next program already, unless the cursor is where it was.
            if (PEEK(s->cursor) != seen) continue;
            if (at < operation_count && chunk != 0xffffffffu)
            {{
                Operation* op = operations + at;
                const unsigned chunks = (unsigned)PEEK(op->chunks);
                if (woken) wake(s, called(chunks));
                woken = false;
                if (chunk < chunks && (called(chunks) >> thread & 1))
                {{
                    if (!__atomic_compare_exchange_n(
                            &s->cursor, &seen, seen + 1, false, __ATOMIC_SEQ_CST, __ATOMIC_RELAXED))
                        continue;
                    const long long start = s->timed ? clock() : 0;
                    const long long low = op->first + op->count * chunk / chunks;
                    const long long high = op->first + op->count * (chunk + 1) / chunks;
                    alignas(16) long long arguments[{LARGEST_ARGUMENTS // 8}];
                    for (long long k = 0; k < op->arguments_size / 8; ++k) arguments[k] = op->arguments[k];
                    ((int*)arguments)[0] = (int)low;
                    if (op->per_thread) ((int*)arguments)[1] = thread;
                    Bounds bounds = {{ (unsigned)(high - low), (unsigned long long)(high - low), 1 }};
                    op->kernel(&bounds, arguments);
                    if (s->timed) __atomic_fetch_add(&op->busy, clock() - start, __ATOMIC_RELAXED);
                    if (__atomic_add_fetch(&s->done, 1, __ATOMIC_ACQ_REL) == chunks)
                    {{
                        if (s->timed)
                        {{
                            const long long now = clock();
                            op->wall += now - s->started;
                            s->started = now;
                        }}
                        __atomic_store_n(&s->done, 0, __ATOMIC_RELAXED);
                        const bool last = at + 1 == operation_count;
                        const unsigned long long next = (unsigned long long)(sequence + 1) << 32;
                        __atomic_store_n(&s->cursor, last ? next | 0xffffffffull : next, __ATOMIC_SEQ_CST);
                        __atomic_store_n(&s->sequence, (unsigned long long)(sequence + 1), __ATOMIC_SEQ_CST);
                        // At the end only the thread that leads has something to do.
                        wake(s, called(last ? 1 : (unsigned)operations[at + 1].chunks));
                    }}
                    since = clock();
                    continue;
                }}
            }}
            else if (leads) return;
            else if (__atomic_load_n(&s->stop, __ATOMIC_SEQ_CST)) return;

            while (PEEK(s->sequence) == published && clock() - since < awake) relax();
            if (clock() - since >= awake)
            {{
                const unsigned long long bit = 1ull << thread;
                s->take_lock(s->lock);
                for (;;)
                {{
                    // Before every look: whoever woke this thread has cleared the bit, and may have been late for an earlier sleep.
                    __atomic_fetch_or(&s->asleep, bit, __ATOMIC_SEQ_CST);
                    if (__atomic_load_n(&s->sequence, __ATOMIC_SEQ_CST) != published) break;
                    if (__atomic_load_n(&s->stop, __ATOMIC_SEQ_CST)) break;
                    s->sleep(s->wakes + {BYTES_OF_A_CONDITION} * thread, s->lock, 0xffffffffu, 0);
                }}
                __atomic_fetch_and(&s->asleep, ~bit, __ATOMIC_SEQ_CST);
                s->give_lock(s->lock);
                since = clock();
                woken = true;
            }}
        }}
    }};
"""


@wp.func_native(
    _STRUCTURES
    + _WORK
    + """
    work((Shared*)shared, thread, false);
"""
)
def work_until_stopped(shared: wp.uint64, thread: int): ...


@wp.func_native(
    _STRUCTURES
    + _WORK
    + f"""
    Shared* s = (Shared*)shared;
#if defined(__aarch64__)
    long long patience;
    __asm__ volatile("mrs %0, cntfrq_el0" : "=r"(patience));
    patience /= {REPEATING_PER_SECOND};
#else
    const long long patience = {TICKS_REPEATING}ll;
#endif
    const long long began = clock();
    for (int times_done = 1;; ++times_done)
    {{
        const unsigned sequence = (unsigned)(s->cursor >> 32) + 1;
        __atomic_store_n(&s->base, (long long)sequence, __ATOMIC_RELAXED);
        __atomic_store_n(&s->operations, (Operation*)operations, __ATOMIC_RELAXED);
        __atomic_store_n(&s->operation_count, (long long)operation_count, __ATOMIC_RELAXED);
        if (s->timed) s->started = clock();
        __atomic_store_n(&s->cursor, (unsigned long long)sequence << 32, __ATOMIC_SEQ_CST);
        __atomic_store_n(&s->sequence, (unsigned long long)sequence, __ATOMIC_SEQ_CST);
        wake(s, called((unsigned)((Operation*)operations)->chunks));
        work(s, 0, true);
        // What is no number is not above the limit, either.
        const bool go_on = watched == 0 || *(volatile float*)watched > limit;
        *(int*)done = times_done;
        if (times_done >= times || !go_on || clock() - began > patience) return;
    }}
"""
)
def lead(
    shared: wp.uint64,
    operations: wp.uint64,
    operation_count: int,
    times: int,
    watched: wp.uint64,
    limit: float,
    done: wp.uint64,
): ...


@wp.func_native(_STRUCTURES + "return clock();")
def clock() -> wp.int64: ...


@wp.kernel
def join_in(shared: wp.uint64, thread: int):
    """Take chunks of whatever programs are carried out, until told to stop."""
    work_until_stopped(shared, thread)


@wp.kernel
def carry_out(
    shared: wp.uint64,
    operations: wp.uint64,
    operation_count: int,
    times: int,
    watched: wp.uint64,
    limit: float,
    done: wp.uint64,
):
    """Carry out a program up to so many times, with all threads that have joined in; ``done`` gets how often that was.

    It ends early once the float at ``watched`` (0: none) is no longer above the limit, and after a while in any case.
    """
    lead(shared, operations, operation_count, times, watched, limit, done)


@wp.kernel
def read_clock(
    # outputs
    ticks: wp.array(dtype=wp.int64),
):
    ticks[0] = clock()
