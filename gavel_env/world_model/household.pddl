; The household domain: the action table of docs/design.md, lifted, for planners that read ADL.
; `aboard` is reflexive and transitive: a thing is aboard itself and whatever holds it up, at any depth. `rides` is the
; part of it without fixed pieces in between: what is near once the robot went to a thing, and what moves with it.
(define (domain household)
(:requirements :adl)
(:types thing room)
(:predicates
  ; what things are
  (fixed ?x - thing) (loose ?x - thing) (surface ?x - thing) (interior ?x - thing) (floor-mounted ?x - thing)
  (door ?x - thing) (switch ?x - thing) (needs-shut ?x - thing) (clearance ?x - thing)
  (heats ?x - thing) (heats-on-top ?x - thing) (heats-when-shut ?x - thing)
  (freezes ?x - thing) (washes ?x - thing) (dries ?x - thing) (rinses ?x - thing) (wipes ?x - thing)
  (cookable ?x - thing) (heatable ?x - thing) (freezable ?x - thing)
  (full-hand-may-operate)
  ; where things are
  (on-top ?x - thing ?y - thing) (inside ?x - thing ?y - thing) (aboard ?x - thing ?y - thing) (rides ?x - thing ?y - thing)
  (on-floor ?x - thing ?r - room) (in-room ?x - thing ?r - room) (lies ?x - thing) (next-to ?x - thing ?y - thing)
  ; the robot
  (near ?x - thing) (robot-in ?r - room) (holding ?x - thing) (carried ?x - thing) (hand-empty)
  ; states
  (opened ?x - thing) (shut ?x - thing) (toggled ?x - thing) (cooked ?x - thing) (washed ?x - thing) (dried ?x - thing)
  (hot ?x - thing) (frozen ?x - thing) (dirty ?x - thing))

(:action navigate-to
  :parameters (?x - thing)
  :precondition (and
    (not (carried ?x))
    (forall (?d - thing ?c - thing) (or (not (aboard ?x ?d)) (not (inside ?d ?c)) (not (shut ?c)))))
  :effect (and
    (forall (?z - thing) (when (or (rides ?z ?x) (aboard ?x ?z) (carried ?z)) (near ?z)))
    (forall (?z - thing) (when (and (not (rides ?z ?x)) (not (aboard ?x ?z)) (not (carried ?z))) (not (near ?z))))
    (forall (?r - room) (when (in-room ?x ?r) (robot-in ?r)))
    (forall (?r - room) (when (not (in-room ?x ?r)) (not (robot-in ?r))))))

(:action grasp
  :parameters (?x - thing)
  :precondition (and
    (near ?x) (loose ?x) (hand-empty)
    (forall (?d - thing ?c - thing) (or (not (aboard ?x ?d)) (not (inside ?d ?c)) (not (shut ?c)))))
  :effect (and
    (holding ?x) (not (hand-empty)) (not (lies ?x))
    (forall (?z - thing) (when (rides ?z ?x) (carried ?z)))
    (forall (?y - thing) (and (not (on-top ?x ?y)) (not (inside ?x ?y)) (not (next-to ?x ?y)) (not (next-to ?y ?x))))
    (forall (?z - thing ?h - thing)
      (when (and (rides ?z ?x) (aboard ?x ?h) (not (rides ?h ?x))) (and (not (aboard ?z ?h)) (not (rides ?z ?h)))))
    (forall (?r - room) (not (on-floor ?x ?r)))
    (forall (?z - thing ?r - room) (when (rides ?z ?x) (not (in-room ?z ?r))))))

(:action release
  :parameters (?x - thing)
  :precondition (holding ?x)
  :effect (and
    (hand-empty) (not (holding ?x)) (lies ?x)
    (forall (?z - thing) (not (carried ?z)))
    (forall (?r - room) (when (robot-in ?r) (on-floor ?x ?r)))
    (forall (?z - thing ?r - room) (when (and (carried ?z) (robot-in ?r)) (in-room ?z ?r)))
    (forall (?o - thing)
      (when (and (near ?o) (lies ?o) (floor-mounted ?o)) (and (next-to ?x ?o) (next-to ?o ?x))))))

(:action place-on-top
  :parameters (?x - thing ?y - thing)
  :precondition (and
    (holding ?x) (near ?y) (surface ?y) (not (rides ?y ?x))
    (forall (?d - thing ?c - thing) (or (not (aboard ?y ?d)) (not (inside ?d ?c)) (not (shut ?c)))))
  :effect (and
    (hand-empty) (not (holding ?x)) (on-top ?x ?y)
    (forall (?z - thing) (not (carried ?z)))
    (forall (?z - thing ?h - thing) (when (and (rides ?z ?x) (aboard ?y ?h)) (aboard ?z ?h)))
    (forall (?z - thing ?h - thing) (when (and (rides ?z ?x) (rides ?y ?h)) (rides ?z ?h)))
    (forall (?z - thing ?r - room) (when (and (carried ?z) (in-room ?y ?r)) (in-room ?z ?r)))
    (when (wipes ?x) (not (dirty ?y)))))

(:action place-inside
  :parameters (?x - thing ?y - thing)
  :precondition (and
    (holding ?x) (near ?y) (interior ?y) (not (shut ?y)) (not (rides ?y ?x))
    (forall (?d - thing ?c - thing) (or (not (aboard ?y ?d)) (not (inside ?d ?c)) (not (shut ?c)))))
  :effect (and
    (hand-empty) (not (holding ?x)) (inside ?x ?y)
    (forall (?z - thing) (not (carried ?z)))
    (forall (?z - thing ?h - thing) (when (and (rides ?z ?x) (aboard ?y ?h)) (aboard ?z ?h)))
    (forall (?z - thing ?h - thing) (when (and (rides ?z ?x) (rides ?y ?h)) (rides ?z ?h)))
    (forall (?z - thing ?r - room) (when (and (carried ?z) (in-room ?y ?r)) (in-room ?z ?r)))
    (forall (?z - thing)
      (when (and (freezes ?y) (not (door ?y)) (freezable ?z)
                 (or (= ?z ?x) (and (inside ?z ?y) (not (fixed ?z))) (on-top ?z ?x) (and (inside ?z ?x) (not (shut ?x)))
                     (exists (?d - thing) (and (inside ?d ?y) (not (fixed ?d))
                       (or (on-top ?z ?d) (and (inside ?z ?d) (not (shut ?d))))))))
        (and (frozen ?z) (not (hot ?z)))))))

(:action open
  :parameters (?y - thing)
  :precondition (and
    (near ?y) (door ?y) (or (hand-empty) (full-hand-may-operate))
    (forall (?d - thing ?c - thing) (or (not (aboard ?y ?d)) (not (inside ?d ?c)) (not (shut ?c)))))
  :effect (and (opened ?y) (not (shut ?y)) (when (needs-shut ?y) (not (toggled ?y)))))

(:action close
  :parameters (?y - thing)
  :precondition (and
    (near ?y) (door ?y) (or (hand-empty) (full-hand-may-operate))
    (forall (?d - thing ?c - thing) (or (not (aboard ?y ?d)) (not (inside ?d ?c)) (not (shut ?c)))))
  :effect (and
    (shut ?y) (not (opened ?y))
    (forall (?z - thing)
      (when (and (freezes ?y) (freezable ?z)
                 (or (and (inside ?z ?y) (not (fixed ?z)))
                     (exists (?d - thing) (and (inside ?d ?y) (not (fixed ?d))
                       (or (on-top ?z ?d) (and (inside ?z ?d) (not (shut ?d))))))))
        (and (frozen ?z) (not (hot ?z)))))))

(:action toggle-on
  :parameters (?y - thing)
  :precondition (and
    (near ?y) (switch ?y) (or (hand-empty) (full-hand-may-operate)) (or (not (needs-shut ?y)) (not (opened ?y)))
    (forall (?d - thing ?c - thing) (or (not (aboard ?y ?d)) (not (inside ?d ?c)) (not (shut ?c)))))
  :effect (and
    (toggled ?y)
    (forall (?z - thing)
      (when (and (heats ?y) (cookable ?z) (or (not (heats-when-shut ?y)) (not (opened ?y)))
                 (or (and (inside ?z ?y) (not (fixed ?z)))
                     (and (on-top ?z ?y) (heats-on-top ?y) (not (fixed ?z)))
                     (exists (?d - thing) (and
                       (not (fixed ?d)) (or (inside ?d ?y) (and (on-top ?d ?y) (heats-on-top ?y)))
                       (or (on-top ?z ?d) (and (inside ?z ?d) (not (shut ?d))))))))
        (cooked ?z)))
    (forall (?z - thing)
      (when (and (heats ?y) (heatable ?z) (or (not (heats-when-shut ?y)) (not (opened ?y)))
                 (or (and (inside ?z ?y) (not (fixed ?z)))
                     (and (on-top ?z ?y) (heats-on-top ?y) (not (fixed ?z)))
                     (exists (?d - thing) (and
                       (not (fixed ?d)) (or (inside ?d ?y) (and (on-top ?d ?y) (heats-on-top ?y)))
                       (or (on-top ?z ?d) (and (inside ?z ?d) (not (shut ?d))))))))
        (and (hot ?z) (not (frozen ?z)))))
    (forall (?z - thing)
      (when (and (washes ?y)
                 (or (and (inside ?z ?y) (not (fixed ?z)))
                     (exists (?d - thing) (and (inside ?d ?y) (not (fixed ?d))
                       (or (on-top ?z ?d) (and (inside ?z ?d) (not (shut ?d))))))))
        (and (washed ?z) (not (dirty ?z)))))
    (forall (?z - thing)
      (when (and (rinses ?y) (not (washes ?y))
                 (or (and (inside ?z ?y) (not (fixed ?z)))
                     (exists (?d - thing) (and (inside ?d ?y) (not (fixed ?d))
                       (or (on-top ?z ?d) (and (inside ?z ?d) (not (shut ?d))))))))
        (not (dirty ?z))))
    (forall (?z - thing)
      (when (and (dries ?y)
                 (or (and (inside ?z ?y) (not (fixed ?z)))
                     (exists (?d - thing) (and (inside ?d ?y) (not (fixed ?d))
                       (or (on-top ?z ?d) (and (inside ?z ?d) (not (shut ?d))))))))
        (dried ?z)))))

(:action toggle-off
  :parameters (?y - thing)
  :precondition (and
    (near ?y) (switch ?y) (or (hand-empty) (full-hand-may-operate))
    (forall (?d - thing ?c - thing) (or (not (aboard ?y ?d)) (not (inside ?d ?c)) (not (shut ?c)))))
  :effect (not (toggled ?y)))
)
